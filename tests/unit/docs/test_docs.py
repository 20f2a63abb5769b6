"""The pages say what the source does: keys, columns, codes, commands and examples."""

import re
import shlex
import shutil
import tomllib
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import get_args

import numpy as np
import pandas as pd
import pytest
import typer
from pydantic import BaseModel

from jointz.analysis.page.details_tables import details_frame, models_frame
from jointz.analysis.study_statistics import quasi_stiffness_rows
from jointz.cli.command_line import command_line
from jointz.control.motor import Motor
from jointz.control.rendering.actuators import ActuatorFile
from jointz.core.channels import CHANNEL_UNITS, LABEL_CHANNELS, OPPOSITE_DIRECTION
from jointz.core.codes import Doubt, Exclusion, Failure
from jointz.core.protocols.protocol_models import LiveSpec
from jointz.core.study import StudySpec
from jointz.demo.demo_study import run_demo
from jointz.identify.estimators import METHODS
from jointz.identify.over_cycle.stride_curves import NODES, StrideCurves
from jointz.identify.record.joint_estimators import ESTIMATORS
from jointz.io.formats import registry as formats
from jointz.results.certificate_result import Certificate
from jointz.results.statistics.quasi_stiffness_fit import QuasiStiffnessDoubt
from jointz.results.study_analysis import StudyAnalysis
from jointz.rig.devices import drivers
from jointz.rig.devices.config import device_file

ROOT = Path(__file__).parents[3]
DOCS = ROOT / "docs"
TOP = [ROOT / name for name in ("README.md", "ARCHITECTURE.md", "CONTRIBUTING.md")]
PAGES = [*TOP, *sorted(p for p in DOCS.rglob("*.md") if "_build" not in p.parts)]
PAGE_NAMES = [str(p.relative_to(ROOT)) for p in PAGES]

_FENCE = re.compile(r"^```(\w+)\n(.*?)^```", re.DOTALL | re.MULTILINE)
_LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)]*)?\)")
_CODE = re.compile(r"`([^`\n]+)`")


def text(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def blocks(language: str) -> dict[str, str]:
    """Return every fenced block of a language, by page and place."""
    return {
        f"{name}-{k}": body
        for page, name in zip(PAGES, PAGE_NAMES, strict=True)
        for k, (found, body) in enumerate(_FENCE.findall(page.read_text(encoding="utf-8")))
        if found == language
    }


def shell_lines() -> list[str]:
    joined = "\n".join(blocks("bash").values()).replace("\\\n", " ")
    return [line for line in dict.fromkeys(joined.splitlines()) if line.strip()]


def words_in_code(name: str) -> set[str]:
    return {word for code in _CODE.findall(text(name)) for word in re.split(r"[\s,=.{}]+", code)}


def row_starting(page: str, cell: str) -> str | None:
    return next(
        (line for line in text(page).splitlines() if line.startswith(f"| `{cell}` |")), None
    )


@pytest.fixture(scope="module")
def cli_script(load_script: Callable[[Path], ModuleType]) -> ModuleType:
    return load_script(DOCS / "make_cli_page.py")


def parse(arguments: list[str]) -> None:
    """Parse a command line as jointz would, without running it."""
    command = typer.main.get_command(command_line())
    while getattr(command, "commands", None):
        while arguments and arguments[0].startswith("-"):
            arguments = arguments[1:]
        if not arguments:
            return
        command, arguments = command.commands[arguments[0]], arguments[1:]
    command.make_context(command.name, list(arguments))


def models(model: type[BaseModel]) -> set[type[BaseModel]]:
    """Return a model and all that stand inside it."""

    def inside(annotation: object) -> set[type[BaseModel]]:
        if isinstance(annotation, type) and issubclass(annotation, BaseModel):
            return models(annotation)
        return {m for part in get_args(annotation) for m in inside(part)}

    found = {m for field in model.model_fields.values() for m in inside(field.annotation)}
    return found | {model}


# --- examples ---------------------------------------------------------------------------------


def test_every_shell_line_is_a_command_that_parses():
    targets = re.findall(r"^([\w-]+):", text("Makefile"), re.MULTILINE)
    lines = shell_lines()
    assert len(lines) > 20
    for words in (shlex.split(line, comments=True) for line in lines):
        if words[0] == "make":
            assert set(words[1:]) <= set(targets)
        elif words[0] == "python":
            assert (ROOT / words[1]).is_file()
        else:
            assert words[0] == "jointz"
            parse(words[1:])


@pytest.mark.parametrize("body", blocks("toml").values(), ids=blocks("toml"))
def test_every_toml_block_is_valid(body):
    content = tomllib.loads(body)

    if "jointz" in content:
        StudySpec.model_validate(content)
    elif "actuator" in content:
        device_file(content)
    elif "delay_s" in content:
        ActuatorFile.model_validate(content)
    elif "resistance_ohm" in content:
        Motor.model_validate(content)
    elif "live" in content:
        LiveSpec.model_validate(content["live"])
    else:
        assert set(content) <= set(StudySpec.model_fields)


def ankle() -> pd.DataFrame:
    """Return the record that pages call ``ankle.csv``."""
    time = np.arange(10_000) / 500.0
    angle, acceleration = np.zeros(time.size), np.zeros(time.size)
    for frequency_hz in (1.3, 3.1, 7.1):
        wave = 0.01 * np.sin(2 * np.pi * frequency_hz * time)
        angle, acceleration = angle + wave, acceleration - (2 * np.pi * frequency_hz) ** 2 * wave
    torque = 50 * angle + 0.02 * acceleration
    return pd.DataFrame({"t": time, "pos": np.rad2deg(angle), "tau": torque})


def python_blocks():
    """Return the blocks of all pages; those of the certificate take minutes, the plan's seconds."""
    for name, body in blocks("python").items():
        long = name.startswith(("docs/certificate.md", "docs/plan.md"))
        marks = [pytest.mark.slow] if long else []
        yield pytest.param(body, id=name, marks=marks)


@pytest.mark.parametrize("body", list(python_blocks()))
def test_every_python_block_runs(body, small_study, tmp_path, monkeypatch, capsys):
    own = shutil.copytree(small_study.root, tmp_path / "my-study")
    toml = (own / "study.toml").read_text()
    # The names of the listing in start.md, and no others.
    for ours, theirs in (("unperturbed", "normal"), ("perturbed", "pulses")):
        assert f"  S01_{theirs}.csv " in text("docs/start.md")
        (own / f"S01_{ours}.csv").rename(own / f"S01_{theirs}.csv")
        toml = toml.replace(f"S01_{ours}.csv", f"S01_{theirs}.csv")
    (own / "study.toml").write_text(toml)
    ankle().to_csv(tmp_path / "ankle.csv", index=False)
    (tmp_path / "jointz-demo").mkdir()
    (tmp_path / "jointz-demo" / "study").symlink_to(own)
    monkeypatch.chdir(tmp_path)

    exec(compile(body, "block", "exec"), {"__name__": "block"})


def test_the_study_of_the_readme_is_analysed_into_files_that_are_described(
    small_study, analyze, tmp_path
):
    toml = next(body for place, body in blocks("toml").items() if place.startswith("README"))
    names = {"time": "t", "angle": "knee_deg", "command": "torque_cmd", "contact": "footswitch"}
    for ours, theirs in (("unperturbed", "normal"), ("perturbed", "pulses")):
        table = pd.read_csv(small_study.root / f"S01_{ours}.csv")
        table["angle"] = np.rad2deg(table["angle"])
        table.rename(columns=names).to_csv(small_study.root / f"S01_{theirs}.csv", index=False)
    simulated = toml.replace('kind = "walking"', 'kind = "walking"\ncoupling = "rigid"')
    (small_study.root / "study.toml").write_text(simulated)

    outcome = analyze(small_study)

    assert outcome.code == 0
    assert 0.5 * 6 * 5 < outcome.json["n_standing"] <= 6 * 5
    written = [p.name for p in (tmp_path / "results").iterdir() if p.is_file()]
    assert [name for name in written if not row_starting("docs/results.md", name)] == []


@pytest.mark.slow
@pytest.mark.timeout(1800)  # two minutes where nothing else runs
def test_the_page_of_methods_shows_the_figures_of_the_demo(tmp_path):
    made = run_demo(tmp_path / "demo", seed=1)

    for one in (made.doublets, made.dissertation):
        rows = one.accuracy().to_dict("records")
        decided = " / ".join(str(row["n_decided"]) for row in rows)
        errors = " / ".join(rounded(row["rms_error_pct"]) for row in rows)
        held = " / ".join(rounded(row["coverage"], 100.0) for row in rows)
        expected = (
            f"| {one.protocol.title} | {decided} of {rows[0]['n_cells']} | {errors} % | {held} % |"
        )
        assert expected in text("docs/methods.md").splitlines()


def rounded(value: float | None, times: float = 1.0) -> str:
    return "-" if value is None else f"{times * value:.0f}"


# --- reference --------------------------------------------------------------------------------


def test_the_page_of_commands_is_what_the_script_makes(cli_script):
    assert text("docs/cli.md") == cli_script.page(), "run python docs/make_cli_page.py"


def test_every_key_of_a_study_is_described():
    keys = {key for model in models(StudySpec) for key in model.model_fields}

    described = words_in_code("docs/study-format.md") | words_in_code("docs/estimator.md")
    assert keys - described == set()
    assert [k for k in StudySpec.model_fields if not row_starting("docs/study-format.md", k)] == []


def test_defaults_of_numbers_are_the_ones_described():
    for model in models(StudySpec):
        for key, field in model.model_fields.items():
            if isinstance(field.default, float) and field.default:
                row = row_starting("docs/study-format.md", key)
                assert row is not None
                assert f"`{field.default}`" in row


def test_every_channel_and_direction_is_described():
    words = words_in_code("docs/study-format.md")

    assert {*CHANNEL_UNITS, *LABEL_CHANNELS, "contact"} - words == set()
    assert set(OPPOSITE_DIRECTION) - words == set()


@pytest.mark.parametrize(
    ("page", "codes"),
    [
        ("docs/results.md", Exclusion),
        ("docs/undecided.md", [*Failure, *Doubt]),
        ("docs/statistics.md", QuasiStiffnessDoubt),
    ],
)
def test_every_code_has_a_row_with_its_meaning(page, codes):
    for code in codes:
        shown = code.status if isinstance(code, Failure) else code.value
        assert row_starting(page, shown) == f"| `{shown}` | {code.meaning} |"


def quasi_stiffness_frame() -> pd.DataFrame:
    cycle = 2 * np.pi * np.linspace(0.0, 1.0, NODES)
    curves = StrideCurves("S01", "left", np.cos([cycle, cycle]), np.sin([cycle, cycle]))
    return pd.DataFrame(quasi_stiffness_rows([curves], {"LRE": 7.0}))


@pytest.mark.parametrize(
    ("file", "frame"),
    [
        ("estimates.csv", StudyAnalysis.to_frame),
        ("population.csv", StudyAnalysis.population_frame),
        ("excluded.csv", StudyAnalysis.excluded_frame),
        ("pulses.csv", StudyAnalysis.pulses_frame),
        ("strides.csv", StudyAnalysis.strides_frame),
        ("single_pulses.csv", StudyAnalysis.single_frame),
        ("details.csv", details_frame),
        ("models.csv", models_frame),
        ("certificate.csv", lambda _: Certificate("rigid", errors=()).to_frame()),
        ("quasi_stiffness.csv", lambda _: quasi_stiffness_frame()),
        ("log_posterior.csv", StudyAnalysis.log_posterior_frame),
    ],
)
def test_every_column_is_described_under_its_file(file, frame):
    page = text("docs/results.md")
    section = page.split(f"\n## {file}", 1)[1].split("\n## ", 1)[0]

    columns = frame(StudyAnalysis(cells=())).columns

    assert len(columns) > 0
    unnamed = [c for c in columns if f"`{c}`" not in section]
    assert unnamed == [], f"describe them in docs/results.md under {file}"


@pytest.mark.parametrize(
    ("names", "page", "sign"),
    [
        (METHODS, "docs/methods.md", "\n## {}\n"),
        (ESTIMATORS, "docs/identify.md", "\n| `{}` |"),
        ([s for s in formats.BUILT_IN if not s.endswith(".gz")], "docs/formats.md", "`{}`"),
        (
            [n.partition(".")[2] for n in drivers.BUILT_IN if not n.startswith("rig.")],
            "docs/devices.md",
            '"{}"',
        ),
    ],
    ids=["methods", "estimators", "formats", "drivers"],
)
def test_what_is_registered_is_described(names, page, sign):
    unnamed = [name for name in names if sign.format(name) not in text(page)]
    assert unnamed == [], f"describe them in {page}"


# --- pages ------------------------------------------------------------------------------------


@pytest.mark.parametrize("page", PAGES, ids=PAGE_NAMES)
def test_every_link_leads_to_a_file_and_no_path_is_of_a_machine(page):
    content = page.read_text()
    links = [link for link in _LINK.findall(content) if "://" not in link]

    assert [link for link in links if not (page.parent / link).exists()] == []
    assert re.findall(r"(?<![\w.])/(?:work|tmp|root|home)\b", content) == []


def test_the_architecture_names_every_package_and_its_rooms():
    packages = {p.parent.name: p.parent for p in (ROOT / "src/jointz").glob("*/__init__.py")}
    rows = dict(re.findall(r"^\| `(\w+)` \| (.*) \|$", text("ARCHITECTURE.md"), re.MULTILINE))
    assert rows.keys() == packages.keys()
    for name, row in rows.items():
        for inner in _CODE.findall(row):
            assert (packages[name] / inner).exists(), f"{name}: {inner}"


def test_the_architecture_names_files_that_exist():
    roots = ("src/jointz", "reproduction")
    files = [f"/{path.relative_to(ROOT)}" for root in roots for path in (ROOT / root).rglob("*.*")]
    for named in _CODE.findall(text("ARCHITECTURE.md")):
        if re.fullmatch(r"[\w/]+\.(py|toml|j2|html\.j2)", named) and named != "pyproject.toml":
            assert named == "study.toml" or any(file.endswith("/" + named) for file in files), named


def test_the_citation_names_the_version_of_the_package():
    version = tomllib.loads(text("pyproject.toml"))["project"]["version"]

    assert f"version: {version}\n" in text("CITATION.cff")


def test_the_docs_define_the_truth_of_an_estimated_b_as_damping_alone():
    run, leg = (" ".join((DOCS / name).read_text().split()) for name in ("run.md", "leg-model.md"))
    assert "of B with `damping` alone" in run
    assert "that of B is `damping`" in leg
    for text in (run, leg):
        assert not re.search(r"damping`? (plus|\+) `?inertia_rate", text)
