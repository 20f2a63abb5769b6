from jointz.results.estimates import ParameterEstimate
from jointz.results.series.frequency_response_curve import ResponseCurve
from jointz.results.series.frequency_response_fit import FrequencyResponseFit


def example() -> FrequencyResponseFit:
    return FrequencyResponseFit(
        model="frf",
        estimator="frequency-domain errors in variables, weighted by the error",
        input="torque",
        parameters=(
            ParameterEstimate("stiffness", 80.0, 79.0, 81.0, "ok", ci_method="sandwich"),
            ParameterEstimate("damping", 1.2, 1.1, 1.3, "ok", ci_method="sandwich"),
            ParameterEstimate("inertia", None, None, None, "undecided"),
        ),
        vaf_pct=99.9,
        vaf_of="angle",
        status="undecided",
        response=ResponseCurve(
            frequency_hz=(1.0, 2.0, 3.0),
            gain=(80.0, 79.0, 75.0),
            phase_rad=(0.1, 0.2, 0.3),
            gain_low=(70.0, 70.0, 70.0),
            gain_high=(90.0, 90.0, 90.0),
            phase_sd_rad=(0.05, 0.05, 0.05),
            coherence=(0.99, 0.98, 0.97),
            fitted_gain=(80.0, 78.5, 75.1),
            fitted_phase_rad=(0.1, 0.21, 0.29),
        ),
        resolution_hz=0.8,
        n_averages=29.0,
        n_samples=30_000,
        rate_hz=1000.0,
        cutoff_hz=58.0,
        condition_number=2.4,
        covariance=((1.0, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, 0.0, 0.01)),
        ci_method="sandwich over 1700 frequencies, Student's t",
        settings={"ci_level": 0.95},
        warnings=("the record is short",),
    )


def test_a_summary_says_what_a_reader_must_know():
    text = example().summary()

    for words in ("stiffness", "80 N*m/rad", "resolution 0.8 Hz", "undecided", "Note: the record"):
        assert words in text


def test_tables_hold_parameters_and_curve():
    fit = example()

    assert fit.to_frame()["parameter"].tolist() == ["stiffness", "damping", "inertia"]
    assert fit.response.table().shape == (3, 9)
    assert ResponseCurve(frequency_hz=(1.0,), gain=(2.0,)).table().columns.tolist() == [
        "frequency_hz",
        "gain",
    ]


def test_a_figure_has_gain_phase_and_coherence():
    labels = [part.get_ylabel() for part in example().plot().child_axes]

    assert labels == ["gain (N·m/rad)", "phase (°)", "coherence"]
