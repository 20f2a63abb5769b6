"""Protocols: the models check themselves and hold every experiment of the dissertation."""

import pytest
from pydantic import ValidationError

from jointz.core.protocols.protocol import Protocol
from jointz.core.protocols.protocol_models import (
    ConditionSpec,
    GaitSpec,
    PerturbationPlan,
    RatesSpec,
)
from jointz.core.protocols.pulse_models import PulseSpec
from jointz.io.protocols import load_protocol

POINTS = {"LRE": 7.0, "MSW": 81.0}


def walking(**changes):
    """Return a small walking protocol as plain values; None takes a key out."""
    content = {
        "jointz_protocol": 1,
        "name": "small",
        "title": "Small",
        "kind": "walking",
        "joint": "knee",
        "gait": {"speed_m_s": 1.2},
        "pulse": {"amplitude_nm": 17.0, "duration_s": 0.25, "hold_s": 0.25},
        "conditions": [
            {"name": "un", "condition": "unperturbed", "prompt": "", "strides": 60},
            {
                "name": "per",
                "condition": "perturbed",
                "prompt": "",
                "perturbations": {
                    "timing_points": POINTS,
                    "count_per_point": 10,
                    "gap_strides": [3, 7],
                },
            },
        ],
    }
    return {k: v for k, v in {**content, **changes}.items() if v is not None}


def bench(condition=None, **changes):
    content = {
        "jointz_protocol": 1,
        "name": "small",
        "title": "Small",
        "kind": "bench",
        "joint": "testbench",
        "conditions": [
            {
                "name": "a",
                "condition": "perturbed",
                "prompt": "",
                "duration_s": 10.0,
                "torque_nm": {"kind": "sine", "amplitude": 5.0, "frequency_hz": 1.4},
                **(condition or {}),
            }
        ],
    }
    first = content["conditions"][0]
    content["conditions"] = [{k: v for k, v in first.items() if v is not None}]
    return {k: v for k, v in {**content, **changes}.items() if v is not None}


def bench_of(*conditions):
    content = bench()
    content["conditions"] = [{**content["conditions"][0], **changes} for changes in conditions]
    return content


def with_plan(**changes):
    content = walking()
    plan = {**content["conditions"][1]["perturbations"], **changes}
    content["conditions"][1]["perturbations"] = {k: v for k, v in plan.items() if v is not None}
    return content


def with_condition(i, **changes):
    content = walking()
    condition = {**content["conditions"][i], **changes}
    content["conditions"][i] = {k: v for k, v in condition.items() if v is not None}
    return content


NOISE = {"kind": "noise", "sd": 1.5, "cutoff_hz": 20.0, "order": 2}


def random_walk(condition=None, **changes):
    """Return a walking protocol with a random torque as plain values; None takes a key out."""
    content = with_condition(
        1, **{"perturbations": None, "strides": 300, "torque_nm": NOISE, **(condition or {})}
    )
    return {k: v for k, v in {**content, "pulse": None, **changes}.items() if v is not None}


def problems(content):
    """Return place -> message of everything that is refused."""
    try:
        Protocol.model_validate(content)
    except ValidationError as exc:
        return {".".join(map(str, e["loc"])): e["msg"] for e in exc.errors()}
    return {}


def control(condition=None, **changes):
    """Return a small protocol with a controller as plain values; None takes a key out."""
    first = {
        "name": "replay",
        "condition": "unperturbed",
        "prompt": "",
        "strides": 40,
        "controller": {"name": "torque_replay", "profile": "published", "settings": {"share": 0.1}},
        **(condition or {}),
    }
    conditions = [{k: v for k, v in first.items() if v is not None}]
    return walking(**{"kind": "control", "pulse": None, "conditions": conditions, **changes})


# --- the dissertation's bench experiments ------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "seconds"),
    [
        ("sea-bandwidth", None),
        ("sea-intrinsic", 3 * 30),
        ("sea-mass-spring", 2 * 7 * (3 * 12 + 13.5 + 16)),
        ("qdd-torque-speed", 7 * 6 * 5),
        ("qdd-chirp", 40),
        ("qdd-static", 60),
        ("qdd-dither", None),
        ("qdd-perturbation", 60 + 60),
    ],
)
def test_the_model_holds_every_bench_protocol_and_knows_how_long_it_takes(name, seconds):
    made = load_protocol(name)

    assert (made.name, made.kind) == (name, "bench")
    assert Protocol.model_validate(made.model_dump(mode="json")) == made
    assert seconds is None or made.expected_duration_s == pytest.approx(seconds)


def test_twenty_pulses_after_rest_fill_sixty_seconds_exactly():
    content = load_protocol("qdd-perturbation").model_dump(mode="json", exclude_unset=True)
    del content["conditions"][1]["duration_s"]
    made = Protocol.model_validate(content)
    content["conditions"][1]["duration_s"] = 59.9

    assert made.expected_duration_s == pytest.approx(120.0)
    assert list(problems(content)) == ["conditions.1.duration_s"]


# --- duration ----------------------------------------------------------------------------------


def test_walking_takes_its_strides_gaps_and_warm_up():
    made = Protocol.model_validate(with_plan(warm_up_strides=20, sham_share=0.5))

    pulses = 2 * (10 + 10)
    assert made.expected_duration_s == pytest.approx((60 + 20 + pulses * 5) * 1.1)


def test_shams_come_on_top_of_the_counts():
    plan = PerturbationPlan(
        timing_points=POINTS, count_per_point=50, gap_strides=(3, 7), sham_share=0.2
    )

    assert set(plan.shams.values()) == {12}  # 12 of 62 is as near to a fifth as whole pulses come
    assert plan.total == 2 * 62


def test_every_timing_point_may_have_a_number_of_pulses_of_its_own():
    counts = {"LRE": 8, "MSW": 24}
    plan = PerturbationPlan(
        timing_points={"LRE": 7.0, "MSW": 81.0},
        count_per_point=counts,
        gap_strides=(3, 7),
        sham_share=0.2,
    )

    assert plan.counts == counts
    assert plan.shams == {"LRE": 2, "MSW": 6}  # a fifth at each
    assert plan.total == 8 + 24 + 8


@pytest.mark.parametrize(
    ("counts", "said"),
    [({"LRE": 8}, "missing for MST"), ({"LRE": 8, "MST": 8, "MSX": 8}, "is no timing point")],
)
def test_numbers_of_pulses_name_exactly_the_timing_points(counts, said):
    with pytest.raises(ValidationError, match=said):
        PerturbationPlan(
            timing_points={"LRE": 7.0, "MST": 21.5}, count_per_point=counts, gap_strides=(3, 7)
        )


# --- parts -------------------------------------------------------------------------------------


def test_the_parts_of_a_pulse_must_add_up_but_for_rounding():
    with pytest.raises(ValidationError, match="duration_s"):
        PulseSpec(amplitude_nm=7, duration_s=0.25, ramp_up_s=0.075, hold_s=0.15, ramp_down_s=0.075)
    PulseSpec(amplitude_nm=7, duration_s=0.3, ramp_up_s=0.1, hold_s=0.1, ramp_down_s=0.1)


@pytest.mark.parametrize(
    "fields",
    [
        *(
            {"timing_points": points, "count_per_point": 1}
            for points in (
                {"A": 100.0}, {"a\n": 7.0}, {"a" * 65: 7.0}, {"A": 7.0, "B": 7.0}, {"all": 7.0}, {}
            )
        ),
        {"timing_points": POINTS},
        {"count_per_point": 3},
        {"timing_points": POINTS, "count_per_point": 1, "count": 2},
        *({"gap_strides": gaps} for gaps in ((7, 3), (0, 3), (3, 10**400))),
        *({"count": 10, "sham_share": share} for share in (0.01, 1.0)),
        {"count": 10**9, "pause_s": 1.0},
        {"timing_points": POINTS, "count_per_point": 10**9},
    ],
)  # fmt: skip
def test_a_plan_that_cannot_be_is_refused(fields):
    with pytest.raises(ValidationError):
        PerturbationPlan(**fields)


def test_points_at_the_ends_of_the_cycle_are_accepted():
    ends = {"A": 0.0, "B": 99.9}
    assert PerturbationPlan(timing_points=ends, count_per_point=1, gap_strides=(1, 1)).total == 2


@pytest.mark.parametrize("band", [(0.0, 1.3), (1.0, 1.3), (0.7, 1.0)])
def test_the_band_of_accepted_strides_lies_about_one(band):
    with pytest.raises(ValidationError, match="accepted_band"):
        GaitSpec(speed_m_s=1.2, accepted_band=band)


def test_the_refractory_time_is_shorter_than_any_stride():
    with pytest.raises(ValidationError, match="refractory_s"):
        GaitSpec(speed_m_s=1.2, refractory_s=0.9)


def test_rates_are_in_whole_ratios():
    for control_hz, sample_hz in ((500, 1000), (900, 300)):
        assert RatesSpec(control_hz=control_hz, sample_hz=sample_hz).sample_hz == sample_hz
    for control_hz, sample_hz in ((500, 900), (1000, 300)):
        with pytest.raises(ValidationError, match="sample_hz"):
            RatesSpec(control_hz=control_hz, sample_hz=sample_hz)


@pytest.mark.parametrize(
    ("field", "name"),
    [
        *(("name", name) for name in ("", "a b", "../up", ".hidden", "é")),
        *(("session", name) for name in ("a/b,c\n", "=1", "a" * 65)),
    ],
)
def test_names_that_fit_neither_files_nor_tables_are_refused(field, name):
    given = {"name": "a", "condition": "unperturbed", "prompt": ""}
    assert ConditionSpec(**given)
    with pytest.raises(ValidationError, match=field):
        ConditionSpec(**given | {field: name})


@pytest.mark.parametrize("speed_m_s", [0.29, 2.21])
def test_a_speed_at_which_nobody_walks_is_one_problem(speed_m_s):
    assert list(problems(walking(gait={"speed_m_s": speed_m_s}))) == ["gait.speed_m_s"]


def test_in_faster_walking_strides_are_shorter_and_pulses_nearer():
    assert GaitSpec(speed_m_s=1.2).assumed_stride_s == 1.1
    assert GaitSpec(speed_m_s=0.3).assumed_stride_s == pytest.approx(2.2)
    short = {"amplitude_nm": 17.0, "duration_s": 0.2145, "hold_s": 0.2145}
    at = {
        speed: problems(
            {**with_plan(gap_strides=[1, 3]), "pulse": short, "gait": {"speed_m_s": speed}}
        )
        for speed in (1.2, 1.3)
    }
    assert at[1.2] == {}
    assert set(at[1.3]) == {"conditions.1.perturbations.gap_strides"}
    usual, slow = (
        Protocol.model_validate(walking(gait={"speed_m_s": speed})) for speed in (1.2, 0.3)
    )
    assert slow.expected_duration_s == pytest.approx(2.0 * usual.expected_duration_s)


# --- the whole ---------------------------------------------------------------------------------

SINE = {"kind": "sine", "amplitude": 5.0, "frequency_hz": 1.4}
PLAN_AT_TIMES = {"count": 4, "pause_s": 1.0}
AT_A_POINT = {"timing_points": {"P": 10.0}, "count_per_point": 2}
PULSE = {"amplitude_nm": 7.0, "duration_s": 0.25, "hold_s": 0.25}

WRONG = [
    (with_condition(0, name="per"), "conditions"),
    (with_condition(0, name="Per"), "conditions"),
    (bench_of({"name": "a", "trials": 2}, {"name": "a-1"}), "conditions"),
    (with_plan(count_per_point=10_000), "conditions.1"),
    (
        bench({"duration_s": 1200.0}, rates={"control_hz": 10_000.0, "sample_hz": 10_000.0}),
        "conditions.0",
    ),
    (walking(safety={"pulse_duty": 0.001}), "safety.pulse_duty"),
    (walking(safety={"pulse_duty": 0.04}), "conditions.1.perturbations"),
    (
        bench({"perturbations": PLAN_AT_TIMES}, pulse=PULSE, safety={"pulse_duty": 0.19}),
        "conditions.0.perturbations",
    ),
    (walking(safety={"sensor_age_s": 0.001}), "safety.sensor_age_s"),
    (walking(gait=None), "gait"),
    (bench(gait={"speed_m_s": 1.0}), "gait"),
    (walking(loads=[{"name": "k"}]), "loads"),
    (bench(loads=[{"name": "k"}], participants=2), "participants"),
    (bench(loads=[{"name": "k"}, {"name": "k"}]), "loads"),
    (bench(loads=[{"name": "k", "inertia": {"value": -1.0, "sd": 0.0}}]), "loads.0.inertia.value"),
    (
        bench(loads=[{"name": "k", "stiffness": {"value": 1e9, "sd": 0.0}}]),
        "loads.0.stiffness.value",
    ),
    (walking(pulse=None), "pulse"),
    (bench(pulse=PULSE), "pulse"),
    (walking(safety={"torque_nm": 16.0}), "pulse.amplitude_nm"),
    (
        walking(
            safety={"torque_rate_nm_s": 100.0},
            pulse={"amplitude_nm": 17, "duration_s": 0.25, "ramp_up_s": 0.1, "hold_s": 0.15},
        ),
        "pulse.ramp_up_s",
    ),
    (
        walking(
            pulse={"amplitude_nm": 17, "duration_s": 0.251, "ramp_up_s": 0.001, "hold_s": 0.25}
        ),
        "pulse.ramp_up_s",
    ),
    (with_condition(0, strides=None), "conditions.0.strides"),
    (with_condition(1, strides=9), "conditions.1.strides"),
    (with_condition(0, duration_s=9.0), "conditions.0.duration_s"),
    (with_condition(0, torque_nm=SINE), "conditions.0.torque_nm"),
    (with_plan(pause_s=2.0), "conditions.1.perturbations.pause_s"),
    (with_condition(1, torque_nm=NOISE), "conditions.1.torque_nm"),
    (random_walk({"strides": None}), "conditions.1.strides"),
    (random_walk({"condition": "no_device"}), "conditions.1.torque_nm"),
    (random_walk({"torque_nm": SINE}), "conditions.1.torque_nm"),
    (random_walk({"position_rad": NOISE}), "conditions.1.position_rad"),
    (random_walk(safety={"torque_nm": 4.4}), "conditions.1.torque_nm"),
    (random_walk({"torque_nm": {**NOISE, "cutoff_hz": 51.0}}), "conditions.1.torque_nm"),
    (bench({"strides": 9}), "conditions.0.strides"),
    (
        bench({"perturbations": {**PLAN_AT_TIMES, "gap_strides": [1, 2]}}, pulse=PULSE),
        "conditions.0.perturbations.gap_strides",
    ),
    (bench({"duration_s": None}), "conditions.0.duration_s"),
    (with_condition(1, perturbations=None, strides=9), "conditions.1.perturbations"),
    (bench({"torque_nm": None}), "conditions.0.perturbations"),
    (with_condition(1, condition="unperturbed"), "conditions.1.perturbations"),
    (bench({"position_rad": SINE, "velocity_rad_s": SINE}), "conditions.0.velocity_rad_s"),
    (with_plan(gap_strides=None), "conditions.1.perturbations.gap_strides"),
    (
        with_plan(timing_points=None, count_per_point=None),
        "conditions.1.perturbations.timing_points",
    ),
    (bench({"perturbations": {"count": 4}}, pulse=PULSE), "conditions.0.perturbations.pause_s"),
    (
        bench(
            {"perturbations": {"count": 3, "pause_s": 1.0}}, pulse={**PULSE, "direction": "both"}
        ),
        "conditions.0.perturbations.count",
    ),
    (with_plan(gap_strides=[1, 3]), "conditions.1.perturbations.gap_strides"),
    (
        bench({"torque_nm": None, "perturbations": AT_A_POINT}, pulse=PULSE),
        "conditions.0.perturbations.timing_points",
    ),
    (
        bench({"position_rad": SINE, "perturbations": AT_A_POINT}, pulse=PULSE),
        "conditions.0.perturbations.timing_points",
    ),
    (
        bench({"perturbations": {"count": 9, "pause_s": 1.0}}, pulse=PULSE),
        "conditions.0.duration_s",
    ),
    (
        {**with_plan(count_per_point=20), "safety": {"pulse_count": 39}},
        "conditions.1.perturbations",
    ),
    (
        bench({"torque_nm": {"kind": "noise", "sd": 9.0, "cutoff_hz": 60.0, "order": 3}}),
        "conditions.0.torque_nm",
    ),
    (
        bench({"perturbations": PLAN_AT_TIMES}, pulse=PULSE, safety={"torque_nm": 11.9}),
        "conditions.0.torque_nm",
    ),
    (bench({"position_rad": SINE}, safety={"angle_max_rad": 1.0}), "conditions.0.position_rad"),
    (control(gait=None), "gait"),
    (control(bench="series-elastic"), "bench"),
    (control(calibration="zero"), "calibration"),
    (control(loads=[{"name": "k"}]), "loads"),
    (control(pulse=PULSE), "pulse"),
    (
        control(pulses=[{"name": "a", "kind": "trapezoid", "amplitudes_nm": [5.0], "hold_s": 0.1}]),
        "pulses",
    ),
    (control(window_s=0.1), "window_s"),
    (control(expected_joint={"stiffness": 1.0, "damping": 0.1, "inertia": 0.1}), "expected_joint"),
    (control(safety={"displacement_rad": 0.1}), "safety.displacement_rad"),
    (control({"controller": None}), "conditions.0.controller"),
    (control({"strides": None}), "conditions.0.strides"),
    (control({"condition": "no_device"}), "conditions.0.condition"),
    (control({"condition": "perturbed"}), "conditions.0.condition"),
    (control({"perturbations": PLAN_AT_TIMES}), "conditions.0.perturbations"),
    (control({"duration_s": 10.0}), "conditions.0.duration_s"),
    (control({"trials": 2}), "conditions.0.trials"),
    (control({"torque_nm": SINE}), "conditions.0.torque_nm"),
    (control({"controller": {"name": "a", "gain": 1.0}}), "conditions.0.controller.gain"),
    (
        control({"controller": {"name": "a", "settings": {"share": float("nan")}}}),
        "conditions.0.controller.settings.share",
    ),
    (control({"controller": {"name": "a", "profile": ""}}), "conditions.0.controller.profile"),
    (with_condition(0, controller={"name": "a"}), "conditions.0.controller"),
    (bench({"controller": {"name": "a"}}), "conditions.0.controller"),
]


@pytest.mark.parametrize("content", [walking(), bench(), control(), random_walk()])
def test_what_the_wrong_ones_are_made_of_is_accepted(content):
    assert problems(content) == {}


@pytest.mark.parametrize(("content", "place"), WRONG, ids=[place for _, place in WRONG])
def test_what_does_not_go_together_is_a_problem_at_its_key(content, place):
    assert place in problems(content)


def test_a_controller_runs_for_its_strides_of_steady_walking():
    made = Protocol.model_validate(control())

    assert made.by_gait
    assert made.expected_duration_s == pytest.approx(40 * 1.1)
    assert Protocol.model_validate(walking()).by_gait
    assert not Protocol.model_validate(bench()).by_gait


def test_a_random_torque_in_walking_lasts_for_its_strides():
    made = Protocol.model_validate(random_walk())

    assert made.expected_duration_s == pytest.approx((60 + 300) * 1.1)


def test_pulses_and_a_random_torque_exclude_each_other():
    (problem,) = problems(with_condition(1, torque_nm=NOISE)).values()

    assert problem.endswith("pulses or a random torque. Remove one of the two.")


def test_pulses_in_a_protocol_of_controllers_are_one_problem_each():
    content = control({"condition": "perturbed", "perturbations": PLAN_AT_TIMES}, pulse=PULSE)

    assert set(problems(content)) == {
        "pulse",
        "conditions.0.condition",
        "conditions.0.perturbations",
    }


def test_all_problems_between_the_parts_come_at_once():
    content = with_plan(pause_s=2.0, gap_strides=[1, 2])
    content.update(safety={"torque_nm": 5.0}, loads=[{"name": "k"}])

    assert set(problems(content)) == {
        "loads",
        "pulse.amplitude_nm",
        "conditions.1.perturbations.pause_s",
        "conditions.1.perturbations.gap_strides",
    }


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("jointz_protocol", 2), ("jointz_protocol", True), ("name", ""), ("title", ""),
        ("participants", 0), ("participants", 2.5), ("participants", 10_001), ("seed", -1),
        ("kind", "running"), ("positive", "up"), ("conditions", []), ("unknown", 1),
        ("rates", {"control_hz": 0.0}), ("rates", {"control_hz": 1e9, "sample_hz": 1e9}),
        ("rates", {"sample_hz": 1.0}), ("rates", {"sample_hz": 100_000.0}),
    ],
)  # fmt: skip
def test_values_out_of_range_are_refused(key, value):
    assert any(place.startswith(key) for place in problems(walking(**{key: value})))


# --- several pulses ----------------------------------------------------------------------------

DOUBLET = {
    "name": "a", "kind": "doublet", "amplitudes_nm": [7.0, 12.0], "durations_s": [0.04, 0.02],
    "direction": "both",
}  # fmt: skip
RAMP = {"name": "b", "kind": "trapezoid", "amplitudes_nm": [7.0], "ramp_up_s": 0.1}
TABLE = {
    "name": "c", "kind": "samples", "amplitudes_nm": [7.0], "times_s": [0.0, 0.1], "shares": [0, 1],
}  # fmt: skip
JOINT = {"stiffness": 60.0, "damping": 2.0, "inertia": 0.3}


def mixed(*pulses, count=12, **changes):
    content = with_plan(count_per_point=count)
    del content["pulse"]
    return content | {"pulses": list(pulses)} | changes


def test_several_pulses_of_all_kinds_hold():
    made = Protocol.model_validate(mixed(DOUBLET, RAMP, TABLE))
    assert [pulse.length_s for pulse in made.shapes] == pytest.approx([0.06, 0.1, 0.1])
    assert Protocol.model_validate(made.model_dump(mode="json")) == made


@pytest.mark.parametrize(
    ("pulse", "place"),
    [
        (DOUBLET | {"second_level": 0.0}, "pulses.0.doublet.second_level"),
        (DOUBLET | {"amplitudes_nm": [7.0, 7.0]}, "pulses.0.doublet.amplitudes_nm"),
        (DOUBLET | {"durations_s": [0.04]}, "pulses.0.doublet.durations_s"),
        (RAMP | {"ramp_up_s": 0.0}, "pulses.0.trapezoid.hold_s"),
        (TABLE | {"times_s": [0.1, 0.2]}, "pulses.0.samples.times_s"),
        (TABLE | {"shares": [0, 0.5]}, "pulses.0.samples.shares"),
        (TABLE | {"shares": [0, 0.5, 1]}, "pulses.0.samples.shares"),
        (DOUBLET | {"durations_s": [0.04, 0.001]}, "pulses.0.durations_s"),
    ],
)
def test_a_shape_that_cannot_be_is_refused_at_its_key(pulse, place):
    assert any(found.startswith(place) for found in problems(mixed(pulse)))


@pytest.mark.parametrize(
    ("content", "place"),
    [
        (mixed(DOUBLET, count=10), "conditions.1.perturbations.count_per_point"),
        (mixed(DOUBLET, DOUBLET, count=16), "pulses"),
        (mixed(DOUBLET) | {"pulse": with_plan()["pulse"]}, "pulses"),
        (mixed(DOUBLET, safety={"torque_nm": 10.0}), "pulses.0.amplitudes_nm"),
        (mixed(DOUBLET, safety={"torque_rate_nm_s": 5000.0}), "pulses.0.second_level"),
        (mixed(DOUBLET, safety={"displacement_rad": 0.2}), "expected_joint"),
        (mixed(DOUBLET, expected_joint=JOINT), "expected_joint"),
        (
            mixed(DOUBLET, expected_joint=JOINT, safety={"displacement_rad": 0.01}),
            "pulses.0.amplitudes_nm",
        ),
    ],
)
def test_what_does_not_go_with_the_pulses_is_refused_at_its_key(content, place):
    assert list(problems(content)) == [place]


def test_what_stays_within_all_limits_is_a_protocol():
    limits = {"torque_nm": 12.0, "torque_rate_nm_s": 12_500.0, "displacement_rad": 0.2}
    assert problems(mixed(DOUBLET, expected_joint=JOINT, safety=limits)) == {}
