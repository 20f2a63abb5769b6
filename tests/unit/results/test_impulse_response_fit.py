import dataclasses

from jointz.results.estimates import ParameterEstimate
from jointz.results.series.impulse_response_fit import ImpulseCurve, ImpulseResponseFit


def example() -> ImpulseResponseFit:
    return ImpulseResponseFit(
        model="irf",
        estimator="frequency-domain errors in variables, weighted by the error",
        input="torque",
        response_of="admittance",
        parameters=(
            ParameterEstimate("stiffness", 80.0, 79.0, 81.0, "ok", ci_method="sandwich"),
            ParameterEstimate("damping", 1.2, 1.1, 1.3, "ok", ci_method="sandwich"),
            ParameterEstimate("inertia", None, None, None, "undecided"),
        ),
        vaf_pct=99.93,
        second_order_vaf_pct=99.95,
        vaf_of="angle",
        status="undecided",
        curve=ImpulseCurve((0.0, 0.1), (0.0, 0.3), (-0.1, 0.2), (0.1, 0.4), (0.0, 0.29)),
        n_kept=2,
        step_s=0.1,
        n_samples=30_000,
        rate_hz=1000.0,
        cutoff_hz=58.0,
        condition_number=2.4,
        covariance=((1.0, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, 0.0, 0.01)),
        ci_method="sandwich over 1700 frequencies, Student's t",
        settings={"length_s": 0.1},
        warnings=("the record is short",),
    )


def test_a_summary_says_what_a_reader_must_know():
    text = example().summary()

    for words in ("lags 0 to 0.1 s", "2 of 2 directions", "99.93 %", "80 N*m/rad", "Note: the"):
        assert words in text
    assert "no lags" in dataclasses.replace(example(), curve=ImpulseCurve()).summary()


def test_the_unit_is_that_of_the_response():
    assert example().unit == "rad/(N*m*s)"
    assert dataclasses.replace(example(), response_of="impedance").unit == "N*m/(rad*s)"


def test_tables_hold_parameters_and_response():
    assert example().to_frame()["value"].tolist()[:2] == [80.0, 1.2]
    assert example().curve.table()["response"].tolist() == [0.0, 0.3]
    assert example().parameter("damping").value == 1.2


def test_a_figure_shows_lags_in_milliseconds():
    ax = example().plot()

    assert ax.lines[0].get_xdata().tolist() == [0.0, 100.0]
    assert ax.get_ylabel() == "admittance impulse response (rad/(N*m*s))"
