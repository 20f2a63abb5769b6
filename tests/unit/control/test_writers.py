"""Files for other software give the same torque as the profile."""

import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from jointz.control.state_machine import (
    DEVIATION_RAD,
    DEVIATION_RAD_S,
    SOFTEST,
    fit_state_machine,
    osl_states,
)
from jointz.control.writers import export_profile
from jointz.core.errors import DataError, OutputError


@pytest.fixture
def states():
    rng = np.random.default_rng(1)
    return np.column_stack(
        [rng.uniform(-50.0, 250.0, 1000), rng.uniform(-0.3, 1.6, 1000), rng.normal(0.0, 5.0, 1000)]
    )


def torque_of(columns, states):
    """Return the torque by columns of a table, in the words of docs/control.md."""

    def at(name):
        return np.interp(states[:, 0], columns["gait_pct"], columns[name], period=100.0)

    return at("stiffness") * (at("equilibrium") - states[:, 1]) - at("damping") * states[:, 2]


def test_csv(profile, states, tmp_path):
    file = export_profile(profile, tmp_path / "knee.csv")
    table = np.genfromtxt(file, delimiter=",", names=True)
    np.testing.assert_array_equal(table["stiffness_low"], profile.stiffness_low)
    np.testing.assert_allclose(torque_of(table, states), profile.torque(*states.T), atol=1e-9)


def test_matlab(profile, states, tmp_path):
    from scipy.io import loadmat

    file = export_profile(profile, tmp_path / "knee.mat")
    columns = loadmat(file, simplify_cells=True)["profile"]
    np.testing.assert_allclose(torque_of(columns, states), profile.torque(*states.T), atol=1e-9)
    assert (str(columns["joint"]), float(columns["mass_kg"])) == ("knee", 75.0)


@pytest.mark.skipif(shutil.which("octave-cli") is None, reason="needs GNU Octave")
def test_matlab_file_in_octave(profile, states, tmp_path):
    export_profile(profile, tmp_path / "knee.mat")
    np.savetxt(tmp_path / "s.txt", states, fmt="%.17g")
    (tmp_path / "run.m").write_text(
        'load knee.mat; s = load("s.txt"); p = profile; x = [p.gait_pct; 100];\n'
        "w = @(v) interp1(x, [v; v(1)], mod(s(:, 1), 100));\n"
        "t = w(p.stiffness) .* (w(p.equilibrium) - s(:, 2)) - w(p.damping) .* s(:, 3);\n"
        'f = fopen("t.txt", "w"); fprintf(f, "%.17g\\n", t); fclose(f);\n'
    )
    subprocess.run(["octave-cli", "-q", "run.m"], cwd=tmp_path, check=True, capture_output=True)
    np.testing.assert_allclose(np.loadtxt(tmp_path / "t.txt"), profile.torque(*states.T), atol=1e-9)


@pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")
@pytest.mark.parametrize("stem", ["knee", "4th person's */ knee"])
def test_c_compiled_and_run(profile, states, tmp_path, stem):
    (tmp_path / stem).parent.mkdir(parents=True, exist_ok=True)
    file = export_profile(profile, tmp_path / f"{stem.split('/')[-1].strip()}.h")
    name = "knee"
    (tmp_path / "main.c").write_text(
        f'#include <stdio.h>\n#include "{file.name}"\nint main(void) {{ double a, b, c;\n'
        'while (scanf("%lf %lf %lf", &a, &b, &c) == 3)\n'
        f'printf("%.17g\\n", {name}_torque(a, b, c));\nreturn 0; }}\n'
    )
    flags = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Werror"]
    subprocess.run(["gcc", *flags, "main.c", "-o", "run", "-lm"], cwd=tmp_path, check=True)
    text = "\n".join(" ".join(map(repr, row)) for row in states.tolist())
    text += "\nnan 0.1 0.1"  # a phase that is no number has no torque
    out = subprocess.run(
        ["./run"], cwd=tmp_path, input=text, capture_output=True, text=True, check=True
    ).stdout
    np.testing.assert_allclose(
        np.array(out.split(), dtype=float), np.append(profile.torque(*states.T), 0.0), atol=1e-9
    )


@pytest.mark.parametrize(
    "subject", ['S*/ int main(void){} /*"\n#define x', "S**// int x;", "S*\N{DEGREE SIGN}/ int x;"]
)
def test_names_cannot_end_a_comment(subject, profile, tmp_path):
    evil = replace(profile, subject=subject)
    text = export_profile(evil, tmp_path / "knee.h").read_text()
    assert text.count("*/") == text.count("/*")
    assert all(line.startswith("/*") for line in text.splitlines() if "define x" in line)
    python = export_profile(evil, tmp_path / "knee.py").read_text()
    assert all(line.startswith(("#", "KNEE_")) for line in python.splitlines())


def test_open_source_leg_constants(profile, tmp_path):
    text = export_profile(profile, tmp_path / "osl.py").read_text()
    values = dict(line.split(" = ") for line in text.splitlines() if not line.startswith("#"))
    fit = fit_state_machine(profile)
    for state in fit.states:
        assert float(values[f"KNEE_K_{state.name}"]) == state.stiffness
        assert float(values[f"KNEE_B_{state.name}"]) == state.damping
        assert np.radians(float(values[f"KNEE_THETA_{state.name}"])) == pytest.approx(
            state.equilibrium
        )
    assert f"{fit.rms_nm:.2f} N*m along the mean stride" in text


def test_files_are_kept_and_suffixes_checked(profile, tmp_path):
    export_profile(profile, tmp_path / "knee.csv")
    with pytest.raises(OutputError, match="exists"):
        export_profile(profile, tmp_path / "knee.csv")
    with pytest.raises(DataError, match=r"\.h, \.mat, \.csv, \.py"):
        export_profile(profile, tmp_path / "knee.txt")
    with pytest.raises(DataError, match="flexion positive"):
        export_profile(replace(profile, positive="extension"), tmp_path / "leg.py")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["knee.csv"]


def least_cost(profile, begin, end):
    """Return the least sum of squares of one state, by another solver than the fit's."""
    velocity = (np.roll(profile.angle, -1) - np.roll(profile.angle, 1))[begin:end]
    velocity = velocity * profile.gait_pct.size / (2.0 * profile.stride_s)
    rows, wanted = [], []
    for i in range(begin, end):
        rows += [
            [-profile.angle[i], -velocity[i - begin], 1.0],
            [DEVIATION_RAD, 0.0, 0.0],
            [0.0, DEVIATION_RAD_S, 0.0],
        ]
        wanted += [
            profile.moment[i],
            DEVIATION_RAD * profile.stiffness[i],
            DEVIATION_RAD_S * profile.damping[i],
        ]
    bounds = [SOFTEST, 0.0, -np.inf], [np.inf, np.inf, np.inf]
    return 2.0 * lsq_linear(np.array(rows), np.array(wanted), bounds, method="bvls").cost


@pytest.mark.parametrize("which", ["profile", "published"])
def test_no_global_search_finds_four_better_states(which, request):
    made = request.getfixturevalue(which)
    fit = fit_state_machine(made)
    toe_off, peak = (round(state.end_pct) for state in fit.states[1:3])
    swing = least_cost(made, toe_off, peak) + least_cost(made, peak, 100)
    stance = min(
        least_cost(made, 0, split) + least_cost(made, split, toe_off)
        for split in range(5, toe_off - 4)
    )
    best = np.sqrt((stance + swing) / 100.0)
    assert toe_off == 62
    assert peak == int(np.argmax(made.angle))
    assert best * 0.999999 <= fit.rms_deviated_nm <= 1.01 * best


def test_published_states():
    states = osl_states()
    assert [s.name for s in states] == ["ESTANCE", "LSTANCE", "ESWING", "LSWING"]
    assert (states[0].stiffness, states[3].damping) == (99.372, 3.816)
    assert np.degrees(states[2].equilibrium) == pytest.approx(60.0)
