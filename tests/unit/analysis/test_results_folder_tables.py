"""Which tables a results folder has, and when."""

import json
from io import BytesIO

import pandas as pd

from jointz.analysis.results_folder import csv_bytes
from jointz.core.events import PulseRecord, StrideRecord
from jointz.results.study_analysis import StudyAnalysis


def test_moments_of_a_clock_that_counts_from_1970_keep_their_milliseconds():
    onset_s, start_s = 1_700_000_000.125, 1_700_000_000.0625
    pulse = PulseRecord("S01", "S01.csv", onset_s, 0.25, 1.0 / 3.0, "ISW", code="gap")
    stride = StrideRecord("S01", "S01.csv", "perturbed", start_s, 1.1, code="gap")
    found = StudyAnalysis((), pulses=(pulse,), strides=(stride,))
    tables = (found.pulses_frame(), found.strides_frame(), found.excluded_frame())
    pulses, strides, excluded = (pd.read_csv(BytesIO(csv_bytes(table))) for table in tables)
    assert pulses["onset_s"].tolist() == [onset_s]
    assert pulses["amplitude"].tolist() == [0.3333333333]
    assert strides["start_s"].tolist() == [start_s]
    assert excluded["onset_s"].tolist() == [onset_s, start_s]
    assert csv_bytes(StudyAnalysis(()).strides_frame()).count(b"\n") == 1


def test_numbers_of_the_methods_are_those_of_the_files_beside_it(small_study, analyze, tmp_path):
    analyze(small_study)
    out = tmp_path / "results"
    text = (
        (out / "methods.txt").read_text(encoding="utf-8").replace("\N{NARROW NO-BREAK SPACE}", "")
    )
    provenance = json.loads((out / "provenance.json").read_text())
    settings = provenance["settings"]
    pulses, excluded = pd.read_csv(out / "pulses.csv"), pd.read_csv(out / "excluded.csv")
    estimates = pd.read_csv(out / "estimates.csv")
    people = [p["id"] for p in provenance["study"]["participants"]]

    assert f"{len(people)} participants ({', '.join(people)})" in text
    assert f"{len(pulses)} pulses of torque were detected" in text
    assert f"duration {1e3 * pulses['duration_s'].unique().item():.0f} ms" in text
    assert f"the mean over {1e3 * settings['window_s']:g} ms of torque" in text
    assert "Responses were analysed at 500 samples per second." in text
    for (_, code), own in excluded.groupby(["kind", "code"]):
        assert f"{len(own)} {code} (" in text
    cells = estimates.drop_duplicates(["participant", "timing_point"])
    used, left_out = cells["n_used"].sum(), cells["n_excluded"].sum()
    assert f"Of {used + left_out} pulses, {used} were used." in text
    statuses = estimates.query("parameter in ('stiffness', 'damping', 'inertia')")["status"]
    assert f"Of {len(statuses)} estimates of K, B and J, {(statuses == 'ok').sum()} ok" in text
    for status, count in statuses[statuses != "ok"].value_counts().items():
        assert f"{count} {status} (" in text
    assert f"jointz {provenance['jointz']}, Python {provenance['python']}" in text
    assert f"seed {settings['seed']}." in text
    assert provenance["study_sha256"][:12] in text
    listed = set(provenance["files"])
    written = {p.relative_to(out).as_posix() for p in out.rglob("*") if p.is_file()}
    assert written - {"provenance.json"} == listed
