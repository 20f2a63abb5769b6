"""Route of the report of a results folder."""

from pathlib import Path
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from fastapi import FastAPI
    from starlette.requests import Request
    from starlette.responses import Response

REPORT: Final = "report.html"
#: The report, and the files it links to.
_FILES: Final = (REPORT, "methods.txt", "methods.tex")
#: A results folder may be a stranger's: its page runs no script beside that of the explorer.
_NO_SCRIPTS: Final = {"content-security-policy": "sandbox allow-same-origin"}


def add_report(app: "FastAPI", folder: Path) -> None:
    """Serve the report of a results folder under ``/report``, and no other file."""
    from starlette.responses import FileResponse, PlainTextResponse

    async def answer(request: "Request") -> "Response":
        name = request.path_params["name"]
        file = folder / name
        # A link may lead to any file of this machine.
        if name not in _FILES or file.is_symlink() or not file.is_file():
            return PlainTextResponse("not found", 404)
        return FileResponse(file, headers=_NO_SCRIPTS)

    app.add_route("/report/{name}", answer)
