"""The ways people lay out a study on disk, each with a joint that is known."""

import numpy as np
import pandas as pd
import pytest

from jointz.analysis.analyze import analyze
from jointz.core.errors import StudyError
from jointz.results.study_analysis import NO_MEANS_ON_A_BENCH

RATE_HZ = 500.0
TRUTH = np.array([50.0, 1.5, 0.05])
HEAD = """
jointz = 1
joint = "knee"
kind = "{kind}"
[channels.time]
column = "t"
unit = "s"
[channels.angle]
column = "angle"
unit = "rad"
[channels.torque]
column = "torque"
unit = "N*m"
"""
CONTACT = '[channels.contact]\ncolumn = "foot"\nkind = "contact"\n'
COMMAND = '[channels.command]\ncolumn = "command"\nunit = "N*m"\n'
PERSON = '[[participants]]\nid = "S01"\nmass_kg = 70\n'


def bump(t):
    total = np.zeros((3, t.size))
    for centre, width, height in ((0.055, 0.018, 0.05), (0.11, 0.03, -0.03)):
        z = (t - centre) / width
        g = height * np.exp(-(z**2) / 2)
        total += [g, -g * z / width, g * (z**2 - 1) / width**2]
    return total


def rows(*, n=22, pulses=(), level=0.0, moving=1.0, start_s=0.0, **columns) -> pd.DataFrame:
    """Strides of 1 s from the first row on."""
    s = np.arange(int(n * RATE_HZ)) / RATE_HZ
    response = sum((bump(s - p) for p in pulses), np.zeros((3, s.size)))
    cycle = moving * 0.3 * np.cos(2 * np.pi * s)
    return pd.DataFrame(
        {
            "t": s + start_s,
            "angle": level + cycle + response[0],
            "torque": moving * 3 * np.sin(4 * np.pi * s) - 10 * level + TRUTH @ response,
            "foot": (np.arange(s.size) % RATE_HZ < 0.6 * RATE_HZ).astype(int),
            "command": sum((17.0 * ((s >= p) & (s < p + 0.2)) for p in pulses), 0 * s),
            **columns,
        }
    )


def entry(condition, file, **more):
    lines = [f'{k} = "{v}"' for k, v in {"participant": "S01", "file": file, **more}.items()]
    if condition:
        lines.append(f'condition = "{condition}"')
    return "[[recordings]]\n" + "\n".join(lines) + "\n"


def analyzed(folder, toml, **tables):
    for name, table in tables.items():
        table.to_csv(folder / f"{name}.csv", index=False)
    (folder / "study.toml").write_text(toml)
    # A few strides without noise, in which the joint moves by itself: not what the recommended
    # methods were made for.
    return analyze(folder, method="dissertation", resamples=20)


def assert_finds_the_joint(cell, *, n_used):
    assert cell.n_used == n_used
    found = [cell.parameter(n).value for n in ("stiffness", "damping", "inertia")]
    np.testing.assert_allclose(found, TRUTH, rtol=1e-3)


def standing(analysis):
    return [c for c in analysis.cells if c.n_used]


PULSES = (6.2, 10.2, 14.2)
CONDITIONS = (
    '[channels.condition]\ncolumn = "phase"\nvalues = { "0" = "unperturbed", "1" = "perturbed" }\n'
)
TRIALS = '[channels.trial]\ncolumn = "run"\n'


def three_trials():
    trials = (("0", 1, ()), ("1", 2, PULSES), ("1", 3, PULSES))
    return pd.concat([rows(phase=p, run=run, pulses=pulses) for p, run, pulses in trials])


def test_one_file_with_conditions_and_trials_whose_time_restarts(tmp_path):
    conditions = CONDITIONS.replace('"perturbed"', '"EWP"')
    toml = HEAD.format(kind="walking") + CONTACT + COMMAND + conditions + TRIALS + PERSON

    found = analyzed(tmp_path, toml + entry(None, "all.csv"), all=three_trials())

    (cell,) = standing(found)
    assert cell.timing_point == "MST"
    assert_finds_the_joint(cell, n_used=6)


#: Two perturbed runs between others, and the onsets of their pulses.
ONSETS = [*(np.array(PULSES) + 22.0), *(np.array(PULSES) + 66.0)]


def several_runs():
    runs = (("0", 0.0, ()), ("1", 22.0, PULSES), ("0", 44.0, ()), ("1", 66.0, PULSES))
    return pd.concat([rows(phase=p, pulses=pulses, start_s=t) for p, t, pulses in runs])


def analyzed_runs(folder, pulses):
    toml = HEAD.format(kind="walking") + CONTACT + CONDITIONS + PERSON
    toml += entry(None, "all.csv", perturbations="pulses.csv")
    return analyzed(folder, toml, all=several_runs(), pulses=pd.DataFrame(pulses))


def test_a_table_of_a_file_with_several_perturbed_runs_counts_each_pulse_once(tmp_path):
    found = analyzed_runs(tmp_path, {"onset_s": ONSETS})

    assert [p.onset_s for p in found.pulses] == pytest.approx(ONSETS)
    assert [p.code for p in found.pulses] == [""] * 6
    (cell,) = standing(found)
    assert_finds_the_joint(cell, n_used=6)


def test_a_pulse_of_a_table_outside_every_perturbed_run_is_left_out_with_a_code(tmp_path):
    onsets = [3.0, *ONSETS, 50.0, 99.0]
    found = analyzed_runs(tmp_path, {"onset_s": onsets, "timing_point": "MST"})

    (cell,) = standing(found)
    assert_finds_the_joint(cell, n_used=6)
    assert cell.n_used + cell.n_excluded == len(onsets)
    left_out = found.excluded_frame().query("kind == 'pulse'")
    assert sorted(left_out["onset_s"]) == [3.0, 50.0, 99.0]
    assert set(left_out["code"]) == {"edge_of_record"}


def test_pulses_that_were_all_left_out_without_a_timing_point_are_not_said_to_be_none(tmp_path):
    early = (1.2, 2.2, 3.2)  # before three strides are known: a trial of a few steps
    tables = {"unperturbed": rows(), "perturbed": rows(pulses=early)}
    toml = HEAD.format(kind="walking") + CONTACT + COMMAND + PERSON
    toml += "".join(entry(condition, f"{condition}.csv") for condition in tables)

    found = analyzed(tmp_path, toml, **tables)

    assert [p.code for p in found.pulses] == ["no_recent_strides"] * 3
    assert set(found.to_frame()["status"]) == {"failed:all_pulses_excluded"}


def test_a_table_for_trials_whose_time_restarts_is_refused(tmp_path):
    toml = HEAD.format(kind="walking") + CONTACT + CONDITIONS + COMMAND + TRIALS + PERSON
    toml += entry(None, "all.csv", perturbations="pulses.csv")
    tables = {"all": three_trials(), "pulses": pd.DataFrame({"onset_s": PULSES})}

    with pytest.raises(StudyError, match=r"all.csv: time starts again in its perturbed trials"):
        analyzed(tmp_path, toml, **tables)

    # The command knows which trial it belongs to.
    found = analyzed(tmp_path, toml + '[perturbations]\nsource = "command"\n', **tables)
    assert_finds_the_joint(standing(found)[0], n_used=6)


def test_a_bench_with_trials_takes_pulses_from_the_difference_of_references(tmp_path):
    def trial(name, condition, *, level, pulses=()):
        table = rows(level=level, pulses=pulses, trial=name, phase=condition)
        return table.assign(ref=np.sin(3 * table["t"]) * (1 + level) + table["command"])

    parts = [
        trial(name, condition, level=level, pulses=pulses)
        for name, level in (("1A", 0.0), ("2B", 0.4))
        for condition, pulses in (("unperturbed", ()), ("perturbed", PULSES))
    ]
    toml = HEAD.format(kind="bench")
    toml += '[channels.reference]\ncolumn = "ref"\nunit = "N*m"\n'
    toml += '[channels.condition]\ncolumn = "phase"\n[channels.trial]\ncolumn = "trial"\n'
    toml += PERSON + entry(None, "bench.csv")

    found = analyzed(tmp_path, toml, bench=pd.concat(parts))

    assert [c.timing_point for c in found.cells] == ["1A", "2B"]
    for cell in found.cells:
        assert_finds_the_joint(cell, n_used=3)
        assert cell.onset_gait_pct is None


def test_loads_of_a_bench_have_no_mean_and_the_results_say_so(tmp_path):
    toml = HEAD.format(kind="bench") + COMMAND + PERSON + PERSON.replace("S01", "S02")
    toml += entry("perturbed", "one.csv") + entry("perturbed", "two.csv").replace("S01", "S02")

    found = analyzed(tmp_path, toml, one=rows(pulses=PULSES), two=rows(pulses=PULSES))

    assert {c.participant for c in found.cells} == {"S01", "S02"}
    assert found.population == ()
    assert NO_MEANS_ON_A_BENCH in found.statistics["notes"]


def test_walking_without_a_contact_uses_the_names_of_the_table(tmp_path):
    onsets = (*PULSES, 18.2)
    pulses = pd.DataFrame({"onset_s": onsets, "timing_point": ["LRE", "MSW", "LRE", "LRE"]})
    toml = HEAD.format(kind="walking") + PERSON
    toml += entry("perturbed", "p.csv", perturbations="pulses.csv")
    toml += '[perturbations]\nbaseline = "pre_pulse"\n'

    found = analyzed(tmp_path, toml, p=rows(moving=0.0, pulses=onsets), pulses=pulses)

    cells = {c.timing_point: c for c in found.cells}
    assert_finds_the_joint(cells["LRE"], n_used=3)
    assert cells["MSW"].parameters[0].status == "failed:too_few_pulses"
    assert cells["MSW"].n_excluded == 1


def test_torque_comes_from_current_by_equation_4_1(tmp_path):
    def motor(table):
        # The torque model holds for the motion as it was measured: motor channels are given.
        velocity = np.gradient(table["angle"], table["t"])
        acceleration = np.gradient(velocity, table["t"])
        friction = 0.4 * np.sign(velocity)
        drag = 0.1 * np.sign(velocity)  # times |current|: solved for the current's sign
        rest = table["torque"] + friction + 0.009 * acceleration
        current = np.where(rest >= 0, rest / (0.9 - drag), rest / (0.9 + drag))
        return table.drop(columns="torque").assign(
            amp=1e3 * current, speed=np.rad2deg(velocity), acc=acceleration
        )

    toml = HEAD.format(kind="walking")
    toml = toml[: toml.index("[channels.torque]")] + CONTACT + COMMAND
    toml += '[channels.current]\ncolumn = "amp"\nunit = "mA"\n'
    toml += '[channels.motor_velocity]\ncolumn = "speed"\nunit = "deg/s"\n'
    toml += '[channels.motor_acceleration]\ncolumn = "acc"\nunit = "rad/s^2"\n'
    toml += "[torque_model]\ngear_ratio = 9.0\ntorque_constant = 0.1\ncoulomb_friction = 0.4\n"
    toml += "gear_friction = 0.1\nrotor_inertia = 0.009\n"
    toml += PERSON + entry("unperturbed", "u.csv") + entry("perturbed", "p.csv")

    found = analyzed(tmp_path, toml, u=motor(rows()), p=motor(rows(pulses=PULSES)))

    (cell,) = standing(found)
    assert_finds_the_joint(cell, n_used=3)


def test_calibrations_of_study_person_and_recording_are_used(tmp_path):
    toml = HEAD.format(kind="walking") + CONTACT + COMMAND
    toml += "[calibration]\ntorque_gain = { value = 1.25, sd = 0.0 }\n"
    toml += "intrinsic_stiffness = { value = 99.0, sd = 0.0 }\n" + PERSON
    toml += "calibration.intrinsic_stiffness = { value = 10.0, sd = 0.5 }\n"
    toml += entry("unperturbed", "u.csv") + entry("perturbed", "p.csv")

    def gained(table):
        return table.assign(torque=1.25 * table["torque"])

    (cell,) = standing(analyzed(tmp_path, toml, u=gained(rows()), p=gained(rows(pulses=PULSES))))

    found = [cell.parameter(n).value for n in ("stiffness", "damping", "inertia")]
    np.testing.assert_allclose(found, TRUTH - [10.0, 0.0, 0.0], rtol=1e-3)
    stiffness = cell.parameter("stiffness")
    assert 0.5 < stiffness.ci_high - stiffness.ci_low < 4.0
