"""The methods section where nobody was perturbed: moment and quasi-stiffness, no impedance."""

from jointz.report.citations import CITATIONS
from jointz.report.methods_text import methods_text


def test_where_nobody_was_perturbed_no_impedance_estimate_is_told_of(unperturbed):
    text = methods_text(unperturbed)
    for never in (
        "pulse of torque", "Impedance was measured", "ridge", "Feldman", "was fitted",
        "Torque was measured", "lag between", "Of 0 pulses", "undecided (",
    ):  # fmt: skip
        assert never not in text
    for said in (
        "Walking was recorded without the device, 42 strides accepted",
        "Recordings have 100 samples a second.",
        "“KneeMoment”, its sign turned to that of the torque on the joint",
        "42 a participant and side",
        "over 6 % of the cycle",
        "95 % intervals are Student's, with one degree of freedom less than strides",
        "(Efron 1982)",
        "Of 6 slopes and secants, 4 without doubt, 1 with doubts, 1 without a value (the angle",
        "Nobody was perturbed: no impedance was estimated.",
    ):
        assert said in text
    assert CITATIONS["jackknife"].full in text
