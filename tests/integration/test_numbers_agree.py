"""Report, terminal, comparison and csv files of five studies have the same numbers."""

import re
from collections import Counter
from html.parser import HTMLParser

import pandas as pd
import pytest

import jointz
from jointz.analysis.printed_analysis import print_analysis
from jointz.analysis.results_folder import write_results
from jointz.comparison.compare import compare_results
from jointz.core.protocols.pulse_models import DoubletPulse
from jointz.io.protocols import load_protocol
from jointz.report.wording import DASH, MINUS
from jointz.rig.session.simulate_study import simulate_study
from jointz.rig.sim.direct_walk import WalkPlan

pytestmark = pytest.mark.slow

POINTS = {"MST": 21.5, "PSW": 56.0}
PARAMETERS = {
    "Stiffness per body mass": "stiffness_per_mass",
    "Damping per body mass": "damping_per_mass",
    "Stiffness at the onset": "stiffness_onset",
    "Damping at the onset": "damping_onset",
    "Stiffness": "stiffness",
    "Damping": "damping",
    "Inertia": "inertia",
}
NUMBER = rf"[+\-{MINUS}]?\d[\d ]*\.?\d*"
INTERVAL = re.compile(rf"({NUMBER}) \[({NUMBER}), ({NUMBER})\]")
SD = re.compile(rf"SD ({NUMBER})(?: \(sample ({NUMBER})\))?")


class Tables(HTMLParser):
    """The tables of a page as rows of text, and its words."""

    def __init__(self, html):
        super().__init__()
        self.tables, self.words, self._cell = [], "", None
        self.feed(html)
        self.words = " ".join(self.words.split())

    def handle_starttag(self, tag, _attrs):
        if tag == "table":
            self.tables.append([])
        elif tag == "tr":
            self.tables[-1].append([])
        elif tag in ("td", "th"):
            self._cell = []

    def handle_endtag(self, tag):
        if tag in ("td", "th"):
            self.tables[-1][-1].append(" ".join(" ".join(self._cell).split()))
            self._cell = None

    def handle_data(self, data):
        self.words += f"{data} "
        if self._cell is not None:
            self._cell.append(data)

    def of_parameters(self):
        """Return heads and rows of every table with a column a parameter."""
        for head, *rows in self.tables:
            names = [next((p for p in PARAMETERS if text.startswith(p)), None) for text in head]
            if sum(name is not None for name in names) > 1:
                yield [PARAMETERS.get(name) for name in names], head, rows


def doublets(folder):
    shape = DoubletPulse(
        name="doublet", kind="doublet", amplitudes_nm=(12.0, 17.0), durations_s=(0.075, 0.045),
        direction="both",
    )  # fmt: skip
    plan = WalkPlan(per_point=16, timing_points=POINTS, pulses=(shape,))
    simulate_study(
        folder, participants=3, preset="realistic", plan=plan, unperturbed_strides=40, seed=4,
        sensors=("goniometer", "encoder", "gyroscopes"),
    )  # fmt: skip


def hold(folder, people=3, **more):
    plan = WalkPlan(per_point=6)
    simulate_study(folder, participants=people, plan=plan, unperturbed_strides=30, **more)


def sessions_and_sides(folder):
    for half in ("one", "two"):
        hold(folder / half, people=2, seed=7 if half == "one" else 8)
    head, *entries = (folder / "one" / "study.toml").read_text().split("[[recordings]]")
    parts = [head]
    for half, stated in (("one", ("day 1", "left")), ("two", ("day 2", "right"))):
        place = 'session = "{}"\nside = "{}"\nfile = "{}/'.format(*stated, half)
        for entry in entries:
            placed = entry.replace('perturbations = "', f'perturbations = "{half}/')
            parts += [placed.replace('file = "', place)]
    (folder / "study.toml").write_text("[[recordings]]".join(parts))


@pytest.fixture(scope="module", params=["doublets", "hold", "two", "bench", "sessions"])
def results(request, tmp_path_factory, short_bench):
    """Return an analysis, the folder of its results and its csv files."""
    study = tmp_path_factory.mktemp(request.param) / "study"
    if request.param == "bench":
        loads = load_protocol("sea-mass-spring").loads[:3]
        protocol = short_bench().model_copy(update={"loads": loads})
        jointz.run(protocol, out=study, preset="clean")
    else:
        make = {"doublets": doublets, "two": lambda f: hold(f, 2, seed=7)}
        make |= {"hold": lambda f: hold(f, seed=3), "sessions": sessions_and_sides}
        make[request.param](study)
    analysis = jointz.analyze(study, resamples=5)
    folder = study.parent / "results"
    write_results(analysis, folder, figures=False)
    names = ("estimates", "population", "pulses", "excluded")
    tables = {n: pd.read_csv(folder / f"{n}.csv", dtype={"session": str}) for n in names}
    return analysis, folder, tables


def agree(text, numbers):
    """Tell whether numbers in words are those of a table, rounded."""
    for written, number in zip(text, numbers, strict=True):
        plain = written.replace(MINUS, "-").replace(" ", "")
        decimals = len(plain.partition(".")[2])
        whole = len(plain.strip("+-")) - 3 if "." not in plain else 0
        assert float(plain) == pytest.approx(number, abs=0.501 * 10.0 ** max(whole, -decimals))


def row_of(table, wanted):
    mine = table
    for column, value in wanted.items():
        mine = mine[mine[column] == value]
    assert len(mine) == 1, wanted
    return mine.iloc[0]


def labels(row):
    stated = [row[k] for k in ("participant", "session", "side") if isinstance(row[k], str)]
    return ", ".join(stated)


def check_cell(text, row):
    """Compare a value, its interval, SDs and n in words with a row of a table."""
    interval = INTERVAL.match(text)
    if interval:
        agree(interval.groups(), row[["value", "ci_low", "ci_high"]])
    else:
        assert pd.isna(row["value"])
        assert text.startswith(DASH) or row["status"].split(":")[0] in text
    if spread := SD.search(text):
        agree([spread[1]], [row["sd"]])
        agree([spread[2]] if spread[2] else [], [row["sample_sd"]] if spread[2] else [])
    if counted := re.search(r"n (\d+)$", text):
        assert int(counted[1]) == row["n_participants"]
    return bool(interval)


def test_every_value_and_mean_of_the_report_is_in_the_csv_files(results):
    _, folder, tables = results
    page = Tables((folder / "report.html").read_text(encoding="utf-8"))
    estimates = tables["estimates"].assign(label=tables["estimates"].apply(labels, axis=1))
    n_checked = 0
    for parameters, head, rows in page.of_parameters():
        label, of_people = "", head[0] in ("Participant", "Load")
        for row in rows:
            label = row[0] or label
            point = {"All points": "all"}.get(row[of_people], row[of_people])
            keys = {"timing_point": point} | ({"label": label} if of_people else {})
            source = estimates if of_people else tables["population"]
            for parameter, text in zip(parameters, row, strict=False):
                if parameter and text not in ("", DASH) and point in set(source["timing_point"]):
                    n_checked += check_cell(text, row_of(source, keys | {"parameter": parameter}))
            if head[-1] == "Pulses" and "/" in row[-1]:
                mine = estimates.query("label == @label and timing_point == @point").iloc[0]
                pulses = [mine["n_used"], mine["n_used"] + mine["n_excluded"]]
                assert list(map(int, row[-1].split("/"))) == pulses
    assert n_checked > 10


def test_counts_of_report_and_terminal_are_those_of_the_csv_files(results, capsys):
    analysis, folder, tables = results
    page = Tables((folder / "report.html").read_text(encoding="utf-8"))
    values = tables["estimates"].query("parameter in ['stiffness', 'damping', 'inertia']")
    statuses = Counter(values["status"])
    available = int(values["value"].notna().sum())
    used = int(tables["pulses"]["code"].isna().sum())
    out = tables["excluded"].query("kind == 'pulse'")["code"]
    excluded = int((out != "aborted").sum())

    assert f"{used} pulses were used and {excluded} excluded" in page.words
    assert f"{available} of {len(values)} values of K, B and J are available" in page.words
    by_status = next(t for t in page.tables if t[0][0] == "Status")
    counted = {row[0]: int(row[1]) for row in by_status[1:]}
    assert {k.split()[-1]: n for k, n in counted.items()} == dict(statuses)
    for name in ("stiffness", "damping", "inertia"):
        means = tables["population"].query("parameter == @name or parameter == @name + '_per_mass'")
        means = means[means["parameter"] == means["parameter"].max()]["value"]
        if said := re.search(rf"{name}(?: per body mass)? at (\w+) of (\d+)", page.words):
            decided = 0 if said[1] == "none" else int(said[1])
            assert (decided, int(said[2])) == (means.notna().sum(), len(means))

    capsys.readouterr()
    print_analysis(analysis, folder / "report.html")
    printed = " ".join(capsys.readouterr().out.split())
    assert f"pulses: {used} used, {excluded} excluded" in printed
    assert f"{available} of {len(values)} values of K, B and J are available" in printed
    for status, n in statuses.items():
        assert status in ("ok", "at_bound") or f"{n} {status}" in printed


def test_every_value_of_the_terminal_is_in_the_csv_files(results, capsys):
    analysis, folder, tables = results
    capsys.readouterr()
    print_analysis(analysis, folder / "report.html")
    found = re.findall(
        r"(\S+) \[(\S+), (\S+)\]", capsys.readouterr().out.replace("[95 % interval]", "")
    )
    known = pd.concat([tables["estimates"], tables["population"]])
    rounded = {
        tuple(f"{x:.3g}" for x in row)
        for row in known[["value", "ci_low", "ci_high"]].dropna().to_numpy()
    }
    assert set(found) <= rounded
    assert found


def test_a_comparison_has_the_means_of_the_folder(results):
    _, folder, tables = results
    if tables["population"].empty:
        pytest.skip("means over loads mean nothing: no comparison of them")
    means = tables["population"].set_index(["timing_point", "parameter"])
    made = compare_results([folder])
    assert made.means
    for mean in made.means:
        row = means.loc[mean.timing_point, mean.parameter]
        if mean.mean is None:
            assert pd.isna(row["value"])
        else:
            numbers = [mean.mean, mean.sd, mean.ci_low, mean.ci_high, mean.n]
            expected = row[["value", "sd", "ci_low", "ci_high", "n_participants"]].astype(float)
            assert numbers == pytest.approx(list(expected), rel=1e-6, nan_ok=True)
