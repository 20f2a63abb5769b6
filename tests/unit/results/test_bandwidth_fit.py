from jointz.results.bench.bandwidth_fit import BandwidthFit
from jointz.results.series.frequency_response_curve import ResponseCurve


def example() -> BandwidthFit:
    return BandwidthFit(
        bandwidth_hz=17.1,
        ci_low_hz=16.9,
        ci_high_hz=17.3,
        ci_level=0.95,
        drop_db=3.0,
        reference_gain=1.0,
        reference_hz=(0.5, 4.8),
        resolution_hz=0.8,
        coherence=0.99,
        response=ResponseCurve(
            frequency_hz=(1.0, 10.0, 20.0),
            gain=(1.0, 0.9, 0.6),
            phase_rad=(0.0, -0.5, -1.0),
            gain_low=(0.9, 0.8, 0.5),
            gain_high=(1.1, 1.0, 0.7),
            phase_sd_rad=(0.1, 0.1, 0.1),
            coherence=(1.0, 0.99, 0.98),
        ),
        method="welch",
        window_s=1.875,
        n_averages=29.0,
        n_samples=30_000,
        rate_hz=1000.0,
        ci_method="delta method",
        settings={"window": "given"},
        warnings=("the coherence is low",),
    )


def test_a_summary_says_what_a_reader_must_know():
    text = example().summary()

    for words in (
        "-3 dB: 17.1 Hz",
        "16.9 to 17.3",
        "resolution 0.8 Hz",
        "coherence 0.990",
        "Note:",
    ):
        assert words in text


def test_a_figure_marks_bandwidth_and_resolution():
    labels = example().plot().get_legend_handles_labels()[1]

    assert {"measured", "-3 dB", "resolution 0.8 Hz"} <= set(labels)
