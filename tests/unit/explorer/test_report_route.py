"""The route of the report serves the report and its texts, and nothing else."""

import pytest

fastapi = pytest.importorskip("fastapi")
testclient = pytest.importorskip("starlette.testclient")

from jointz.explorer.page import add_report  # noqa: E402 - needs the extra


def test_only_the_report_of_the_folder_is_served(tmp_path):
    folder = tmp_path / "results"
    folder.mkdir()
    (folder / "report.html").write_text("<h1>Knee</h1>")
    (tmp_path / "secret.txt").write_text("secret")
    (folder / "methods.txt").symlink_to(tmp_path / "secret.txt")
    app = fastapi.FastAPI()
    add_report(app, folder)
    client = testclient.TestClient(app)
    report = client.get("/report/report.html")
    assert (report.status_code, report.text) == (200, "<h1>Knee</h1>")
    assert report.headers["content-security-policy"].startswith("sandbox")
    for name in ("methods.txt", "methods.tex", "estimates.csv", "..%2fsecret.txt"):
        assert client.get(f"/report/{name}").status_code == 404
