"""What a plan says, and how it answers wishes."""

import re
import tomllib
from dataclasses import replace

import numpy as np
import pytest

import jointz
from jointz.core.errors import DataError
from jointz.planning.predicted_estimates import ENDLESS, typical_leg
from jointz.planning.schedule import schedule_of_protocol

NAMES = ("stiffness", "damping", "inertia")
HOLDS = [{"name": "hold", "kind": "trapezoid", "amplitudes_nm": (8.0,), "hold_s": 0.25}]


def halves(plan, field="half_width_pct"):
    return np.array([getattr(e, field) for e in plan.estimates])


def nearest(plan, option):
    """Return the wish that a refusal names as the nearest one for an option of the command."""
    (text,) = plan.refused
    named = re.search(rf"{option} (\d+(?:\.\d+)?)", text.split("Nearest:")[1])
    assert named, text
    return float(named[1])


# --- without a wish ------------------------------------------------------------------------------


def test_without_a_wish_the_numbers_are_the_protocols(made, doublets):
    assert [(e.timing_point, e.parameter, e.pulses) for e in made.estimates] == [
        ("MST", name, 48) for name in NAMES
    ]
    assert made.participants == doublets.participants
    assert made.refused == ()
    # 60 and 60 strides of other walks, 48 pulses five strides apart.
    warm_up = doublets.conditions[-1].perturbations.warm_up_strides
    stride_s = doublets.gait.assumed_stride_s
    assert made.minutes == pytest.approx((120 + warm_up + 5 * 48) * stride_s / 60.0)


def test_a_number_of_an_estimate_lies_where_it_must(made):
    for e in made.estimates:
        assert e.endless_pct < e.half_width_pct
        assert e.half_width_pct < e.assured_pct
        assert 0.0 <= e.decided_share <= 1.0
        assert e.decidable


def test_the_same_seed_makes_the_same_plan_and_progress_is_told(made, doublets):
    steps = []

    again = jointz.plan(doublets, progress=lambda *step: steps.append(step))

    assert replace(again, provenance={}) == replace(made, provenance={})
    done = [step[0] for step in steps]
    assert done == sorted(done)
    assert all(step[0] <= step[1] and step[2] for step in steps)


def test_one_shape_is_chosen_of_those_that_may_be(made):
    (chosen,) = [s for s in made.shapes if s.chosen]

    assert chosen.text == made.pulses
    assert chosen.why_not == ""
    assert chosen.peak_deg == made.peak_deg
    assert made.shapes[0].name == "as in the protocol"


def test_what_would_be_bought_narrows(made):
    rows = {
        m.what: np.array([m.stiffness_pct, m.damping_pct, m.inertia_pct]) for m in made.measures
    }
    planned = rows.pop("as above")

    assert {"with encoder", "with gyroscopes", "with encoder and gyroscopes"} < set(rows)
    assert (planned == halves(made)).all()
    for what, row in rows.items():
        assert (row <= planned * 1.001).all(), what
    assert (rows["with encoder and gyroscopes"] <= 1.02 * rows["with encoder"]).all()


def test_sources_are_shares(made):
    assert set(made.sources) == set(NAMES)
    for shares in made.sources.values():
        assert all(0.0 <= share <= 1.0 for share in shares.values())


def test_more_people_tell_more(made):
    for name in NAMES:
        rows = [p for p in made.people if p.parameter == name]
        assert [p.participants for p in rows] == sorted(p.participants for p in rows)
        for field in ("mean_pct", "paired_pct", "groups_pct", "difference_half_width_pct"):
            values = [getattr(p, field) for p in rows]
            assert values == sorted(values, reverse=True), field


# --- pulses and sensors --------------------------------------------------------------------------


def test_more_pulses_never_widen(doublets, lab):
    leg = typical_leg(lab(doublets), schedule_of_protocol(doublets).design)
    seen = [leg.estimates({"MST": n}).half_width for n in (8.0, 16.0, 48.0, 120.0, 240.0, ENDLESS)]

    assert (np.diff(seen, axis=0) < 0.0).all()


def test_three_sensors_are_not_wider_than_one(doublets, lab):
    design = schedule_of_protocol(doublets).design
    one = typical_leg(lab(doublets), design)
    three = typical_leg(lab(doublets, "encoder", "gyroscopes"), design)

    for n in (8.0, 48.0, ENDLESS):
        wide, narrow = (leg.estimates({"MST": n}).half_width for leg in (one, three))
        assert (narrow < wide).all()


def test_a_hold_leaves_stiffness_and_damping_undecidable_and_says_so(small_protocol, see):
    held = see(small_protocol(pulses=HOLDS))

    assert {e.parameter for e in held.undecidable} == {"stiffness", "damping"}
    assert [e.decided_share for e in held.undecidable] == [0.0, 0.0]
    for letter in "KB":
        (note,) = [n for n in held.notes if n.startswith(f"No number of pulses decides {letter} ")]
        assert "MST" in note
    assert "No number of pulses decides K at MST, B at MST." in held.summary()


def test_a_plan_replaces_holds(small_protocol, bare_plan):
    plan = bare_plan(small_protocol(pulses=HOLDS))

    own = plan.shapes[0]
    assert not own.chosen
    assert own.why_not.startswith("decides nothing that was asked for")
    assert plan.undecidable == ()


def test_own_pulses_stay_where_others_are_not_better(made, tmp_path, bare_plan):
    file = tmp_path / "planned.toml"
    file.write_text(made.protocol_text)

    again = bare_plan(file)

    assert [s.name for s in again.shapes if s.chosen] == ["as in the protocol"]
    assert again.pulses == made.pulses


def test_motion_is_limited(doublets, bare_plan):
    plan = bare_plan(doublets, motion_deg=6.0)

    # The margin is that of rounded amplitudes.
    assert plan.peak_deg <= 1.1 * 6.0
    for shape in plan.shapes:
        assert (shape.peak_deg > 6.6) == shape.why_not.startswith("moves the joint further than 6")


def test_torque_is_limited(doublets, bare_plan):
    plan = bare_plan(doublets, torque_nm=9.0)

    assert plan.shapes[0].why_not == "needs 17 N*m"
    assert max(size for course in plan.courses for size in course.amplitudes_nm) <= 9.0


def test_a_slower_torque_widens(doublets, made, bare_plan):
    slow = bare_plan(doublets, bandwidth_hz=8.0)

    assert (halves(slow) > halves(made)).all()


# --- wishes --------------------------------------------------------------------------------------


def test_a_kept_half_width_takes_the_fewest_pulses(doublets, made, bare_plan):
    wish = float(np.ceil(halves(made, "assured_pct")[2])) + 2.0

    plan = bare_plan(doublets, half_width_pct=wish, parameters=("inertia",))

    assert plan.refused == ()
    assert plan.estimates[0].pulses < 48
    assert halves(plan, "assured_pct")[2] <= 1.02 * wish


def test_the_nearest_half_width_is_kept(doublets, bare_plan):
    refused = bare_plan(doublets, half_width_pct=6.0, parameters=("inertia",))

    (text,) = refused.refused
    assert text.startswith("J to 6 % in 80 of 100 legs cannot be had with 240 pulses at MST")
    assert "nor with more pulses at any of them" in text
    assert refused.protocol_text == ""
    wish = nearest(refused, "--half-width")
    kept = bare_plan(doublets, half_width_pct=wish, parameters=("inertia",))
    assert kept.refused == ()
    assert kept.protocol_text


def test_noise_widens_and_what_would_be_undecided_is_no_nearest_half_width(
    doublets, made, bare_plan
):
    noisy = bare_plan(doublets, half_width_pct=12.0, sensors={"goniometer": np.deg2rad(3.0)})

    assert (halves(noisy, "endless_pct") > halves(made, "endless_pct")).all()
    (text,) = noisy.refused
    assert text.startswith("K and B to 12 % in 80 of 100 legs cannot be had")
    assert "Nearest: more --motion, --torque or sensors" in text


def test_minutes_or_half_width_nearest_to_both_are_kept(doublets, made, bare_plan):
    wish = float(np.ceil(halves(made, "assured_pct")[2]))
    inertia = {"parameters": ("inertia",)}
    both = bare_plan(doublets, half_width_pct=wish, minutes=5.0, **inertia)

    minutes, width = nearest(both, "--minutes"), nearest(both, "--half-width")

    longer = bare_plan(doublets, half_width_pct=wish, minutes=minutes, **inertia)
    assert longer.refused == ()
    assert longer.minutes <= minutes
    wider = bare_plan(doublets, half_width_pct=width, minutes=5.0, **inertia)
    assert wider.refused == ()
    assert wider.minutes <= 5.0


def test_too_few_minutes_for_a_round_name_those_that_are_enough(doublets, bare_plan):
    short = bare_plan(doublets, minutes=1.0)

    assert "8 pulses at 1 timing point need 3.12 min" in short.refused[0]
    enough = bare_plan(doublets, minutes=nearest(short, "--minutes"))
    assert enough.refused == ()
    assert enough.minutes <= nearest(short, "--minutes")


def test_few_minutes_and_a_half_width_name_the_minutes_that_keep_both(doublets, bare_plan):
    wish = {"half_width_pct": 30.0, "parameters": ("inertia",)}
    short = bare_plan(doublets, minutes=1.0, **wish)

    assert bare_plan(doublets, minutes=nearest(short, "--minutes"), **wish).refused == ()


def test_minutes_alone_are_filled_where_the_interval_is_widest(small_protocol, bare_plan):
    plan = bare_plan(small_protocol(points={"LRE": 7.0, "MSW": 81.0}), minutes=20.0)

    assert plan.refused == ()
    assert 19.0 < plan.minutes <= 20.0
    widest = [
        max(e.assured_pct for e in plan.estimates if e.timing_point == point)
        for point in plan.timing_points
    ]
    assert max(widest) < 1.1 * min(widest)
    assert len({e.pulses for e in plan.estimates}) == 2


def test_a_nearest_wish_is_the_nearest_to_a_percent(small_protocol, bare_plan):
    spec = small_protocol(points={"LRE": 7.0, "MSW": 81.0})
    asked = {"parameters": ("inertia",), "minutes": 6.0}
    refused = bare_plan(spec, half_width_pct=5.0, **asked)
    width = nearest(refused, "--half-width")

    assert bare_plan(spec, half_width_pct=width, **asked).refused == ()
    assert bare_plan(spec, half_width_pct=0.99 * width, **asked).refused


def test_two_wishes_of_people_name_people_who_keep_both(doublets, bare_plan):
    wishes = {"mean_pct": 25.0, "difference_pct": 40.0}
    few = bare_plan(doublets, participants=3, **wishes)
    named = {re.search(r"--participants (\d+)", text)[1] for text in few.refused}

    assert len(few.refused) == 2
    (people,) = named
    assert bare_plan(doublets, participants=int(people), **wishes).refused == ()


def test_aborted_pulses_are_predicted_and_fewer_with_less_motion(made, doublets, bare_plan):
    small = bare_plan(doublets, motion_deg=8.0)

    assert 0.0 <= small.aborted_share < made.aborted_share < 0.2
    (note,) = (n for n in made.notes if n.startswith("The limit of displacement"))
    assert f"abort {100.0 * made.aborted_share:.1f} % of the pulses" in note


def test_notes_of_the_protocol_are_not_copied(doublets, made):
    assert doublets.notes
    assert "notes" not in tomllib.loads(made.protocol_text)


@pytest.mark.parametrize(
    ("wish", "option"), [("mean_pct", "--mean"), ("difference_pct", "--difference")]
)
def test_people_or_a_wish_nearest_are_kept(doublets, wish, option, bare_plan):
    few = bare_plan(doublets, participants=6, **{wish: 32.0})

    people, width = int(nearest(few, "--participants")), nearest(few, option)

    assert people > 6
    assert bare_plan(doublets, participants=6, **{wish: width}).refused == ()
    free = bare_plan(doublets, **{wish: 32.0})
    assert free.refused == ()
    assert free.participants == people
    assert any(p.participants == people for p in free.people)


def test_a_mean_that_nobody_reaches_names_one_that_is_reached(doublets, monkeypatch, bare_plan):
    monkeypatch.setattr("jointz.planning.planner.MOST_PEOPLE", 12)

    never = bare_plan(doublets, mean_pct=2.0)

    (text,) = never.refused
    assert text.startswith(
        "--mean 2 % of K and B cannot be had with 12 participants. Nearest: --mean "
    )
    most = [p.mean_pct for p in never.people if p.participants == 12]
    assert nearest(never, "--mean") == pytest.approx(max(most[:2]), rel=0.01)


# --- bad input -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (
            {"sensors": {"goniometer": None, "imu": None}},
            "encoder, gyroscopes; got goniometer, imu",
        ),
        ({"sensors": {"encoder": None}}, "expected a goniometer.*got encoder"),
        ({"sensors": {"goniometer": 0.0}}, "noise above 0 .* of goniometer"),
        ({"sensors": {"goniometer": float("nan")}}, "noise above 0 .* of goniometer"),
        ({"half_width": 20.0}, "wishes among half_width_pct,.*got half_width"),
        ({"half_width_pct": 0.0}, "half_width_pct: expected 1 to .*, got 0"),
        ({"half_width_pct": float("nan")}, "half_width_pct: expected 1 to"),
        ({"share": 80.0}, "share: expected 0.5 to 0.95, got 80"),
        ({"participants": 0, "minutes": 0.0}, "minutes: .*; participants: expected 1 to 200"),
        ({"motion_deg": 20.0}, "motion_deg: expected 0.5 to 18"),
        ({"parameters": ("K",)}, "expected some of stiffness, damping, inertia"),
        ({"parameters": ()}, "expected some of stiffness, damping, inertia"),
        ({"bandwidth_hz": 0.0}, "bandwidth_hz: expected 1 to 200"),
        ({"torque_nm": -1.0}, "torque_nm: expected 0.5 to 300"),
        ({"mass_kg": 0.0}, "mass_kg: expected 10 to 300"),
        ({"mass_kg": float("inf")}, "mass_kg: expected 10 to 300"),
        ({"height_m": 175.0}, "height_m: "),
        ({"sensors": {}}, "expected a goniometer"),
        ({"participants": 2.5}, "participants: "),
        ({"seed": -1}, "seed"),
        ({"torque_nm": 0.0}, "torque_nm: expected 0.5 to 300"),
        ({"torque_nm": float("inf")}, "torque_nm: expected 0.5 to 300"),
        ({"bandwidth_hz": float("inf")}, "bandwidth_hz: expected 1 to 200"),
        ({"sensors": {"goniometer": float("inf")}}, "goniometer"),
        ({"height_m": -1.0, "mass_kg": -2.0}, "mass_kg: .*height_m: "),
    ],
    ids=str,
)
def test_bad_numbers_and_names_are_refused(doublets, given, says):
    with pytest.raises(DataError, match=says):
        jointz.plan(doublets, **given)


@pytest.mark.parametrize("name", ["sea-mass-spring", "walking_random", "knee_controller"])
def test_a_protocol_without_pulses_in_walking_is_refused(name):
    with pytest.raises(DataError, match=rf"{name} has no pulses in walking.*walking_doublets"):
        jointz.plan(name)


def test_another_joint_is_refused(doublets):
    with pytest.raises(DataError, match="priors are of a knee, and walking_doublets is of the ank"):
        jointz.plan(doublets.model_copy(update={"joint": "ankle"}))


def test_a_protocol_that_is_none_is_refused():
    with pytest.raises(DataError, match="no-such"):
        jointz.plan("no-such")
