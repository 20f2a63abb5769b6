"""A certificate of a whole study: simulated people walk its protocol."""

import shutil

import numpy as np
import pytest

from jointz.analysis.analyze import analyze
from jointz.analysis.certify import certify
from jointz.analysis.study_protocol import study_protocol
from jointz.core.errors import DataError
from jointz.core.protocols.pulse_models import DoubletPulse
from jointz.io.study_reader import open_study
from jointz.results.certificate_result import STATISTICS
from jointz.rig.certificate.certificate_step import compared_statistics
from jointz.rig.session.simulate_study import simulate_study
from jointz.rig.sim.direct_walk import WalkPlan

DOUBLET = DoubletPulse(
    name="short", kind="doublet", amplitudes_nm=(17.0,), durations_s=(0.039, 0.021),
    direction="both",
)  # fmt: skip
POINTS = {"early": 20.0, "late": 60.0}


def doublet_study(folder):
    plan = WalkPlan(per_point=4, pulses=(DOUBLET,), timing_points=POINTS)
    return simulate_study(folder, preset="realistic", participants=1, plan=plan, seed=4)


@pytest.fixture(scope="module")
def doublets(tmp_path_factory):
    return doublet_study(tmp_path_factory.mktemp("doublets") / "study")


@pytest.fixture(scope="module")
def strapped(doublets):
    told = []
    return certify(doublets, people=1, seed=3, progress=lambda *a: told.append(a)), told


def test_simulated_people_are_analysed_at_every_timing_point(strapped):
    found, told = strapped

    assert (found.method, found.world, found.n_participants) == ("bayesian", "realistic", 1)
    assert {(e.participant, e.timing_point) for e in found.estimates} == {
        ("V01", point) for point in POINTS
    }
    assert all(e.truth > 0.0 for e in found.estimates)
    assert [t[:2] for t in told] == [(0, 2), (1, 2), (2, 2), (2, 2)]


def test_one_person_is_too_few_for_a_promise(strapped):
    assert strapped[0].status == "cannot_promise"


def protocol_of(study):
    analysis = analyze(study, method="least_squares", resamples=2, progress=False)
    return study_protocol(open_study(study), analysis.pulses, analysis.strides)


def test_the_protocol_is_that_of_the_study(doublets):
    protocol = protocol_of(doublets)

    assert protocol.sensors == ("joint_encoder", "shank_velocity", "thigh_velocity")
    assert [p.direction for p in protocol.pulses] == ["positive", "negative"]
    assert [p.sizes_nm for p in protocol.pulses] == [(17.0,), (17.0,)]
    assert all(p.length_s == pytest.approx(0.06) for p in protocol.pulses)
    assert "reversed after 40 ms" in protocol.text
    for point, onset_pct in POINTS.items():
        assert protocol.timing_points[point] == pytest.approx(onset_pct, abs=1.0)


def test_without_a_command_the_measured_torque_shows_the_second_level(doublets, tmp_path):
    study = shutil.copytree(doublets, tmp_path / "study")
    file = study / "study.toml"
    lines = file.read_text().splitlines(keepends=True)
    file.write_text("".join(li for li in lines if not li.startswith("channels.command")))

    for pulse in protocol_of(study).pulses:
        assert pulse.durations_s[0] == pytest.approx(0.039, abs=0.006)
        assert pulse.second_level == -1.0


def test_the_same_seed_gives_the_same_certificate(small_study_source):
    first, again = (certify(small_study_source, people=1, seed=1) for _ in range(2))

    assert first.world == "realistic, rigid coupling"
    assert first.estimates == again.estimates


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('kind = "walking"\ncoupling = "rigid"', 'kind = "bench"', 'kind "bench"'),
        ('joint = "knee"', 'joint = "ankle"', "knee only.*ankle"),
    ],
)
def test_a_study_that_nobody_can_repeat_is_refused(small_study, old, new, message):
    small_study.edit_toml(old, new)

    with pytest.raises(DataError, match=message):
        certify(small_study.root, people=1)


def test_nobody_is_no_number_of_people(small_study_source):
    with pytest.raises(ValueError, match="people: expected at least 1"):
        certify(small_study_source, people=0)


def people(rng, n, factor=1.0):
    return [
        {
            name: 30.0 if name == "without_value_pct" else factor * np.exp(0.3 * z)
            for name, z in zip(STATISTICS, rng.standard_normal(len(STATISTICS)), strict=True)
        }
        for _ in range(n)
    ]


@pytest.mark.slow
def test_people_of_one_population_seldom_differ():
    rng = np.random.default_rng(1)
    differ = [
        any(row.differs for row in compared_statistics(people(rng, 6), people(rng, 10), seed=1))
        for _ in range(100)
    ]

    assert np.mean(differ) < 0.12


def test_people_of_another_population_differ_in_the_direction():
    rng = np.random.default_rng(1)
    rows = compared_statistics(people(rng, 6, factor=5.0), people(rng, 10), seed=1)

    assert [row.name for row in rows if not row.differs] == ["without_value_pct"]
    assert "less predictable" in {row.name: row for row in rows}["unpredictability_deg"].sentence
