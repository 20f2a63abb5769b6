"""The methods section where nobody was perturbed: moment and quasi-stiffness, no impedance."""

from dataclasses import replace

import pytest

from jointz.analysis.paper.citations import CITATIONS
from jointz.analysis.paper.methods_text import methods_text


def test_where_nobody_was_perturbed_no_impedance_estimate_is_told_of(unperturbed):
    text = methods_text(unperturbed)
    for never in (
        "pulse of torque", "Impedance was measured", "ridge", "Feldman", "was fitted",
        "Torque was measured", "lag between", "Of 0 pulses", "undecided (",
    ):  # fmt: skip
        assert never not in text
    for said in (
        "Walking was recorded without the device, 42 strides accepted",
        "Recordings have 100 samples per second.",
        "“KneeMoment”, its sign inverted to that of the torque on the joint",
        "42 for each participant and side",
        "over 6 % of the cycle",
        "95 % intervals are t intervals of the delete-one jackknife over strides (Efron 1982)",
        "Of 6 slopes and secants, 4 without doubt, 1 with doubts, 1 without a value (the angle",
        "Nobody was perturbed: no impedance was estimated.",
    ):
        assert said in text
    assert CITATIONS["jackknife"].full in text


@pytest.mark.parametrize(
    ("side", "positive", "said"),
    [
        ("device", "flexion", "its sign inverted to that of the torque on the joint"),
        ("device", "extension", "its sign unchanged"),  # inverted twice, that is, not at all
        ("joint", "flexion", "its sign unchanged"),
        ("joint", "extension", "its sign inverted to that of the torque on the joint"),
    ],
)
def test_the_sign_of_the_moment_is_told_as_it_was_read(unperturbed, side, positive, said):
    told = unperturbed.provenance["study"]
    torque = {**told["channels"]["torque"], "positive": positive}
    study = {
        **told,
        "positive": "flexion",
        "torque_acts_on": side,
        "channels": {**told["channels"], "torque": torque},
    }
    text = methods_text(replace(unperturbed, provenance={"study": study}))
    assert f"“KneeMoment”, {said}." in text
