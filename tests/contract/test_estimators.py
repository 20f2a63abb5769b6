"""Every method keeps the contract of estimators, and the contract notices one that does not."""

from dataclasses import replace

import pytest

from jointz.identify.estimators import METHODS
from jointz.rig.testing.estimator_contract import EstimatorContract

CHECKS = [name for name in dir(EstimatorContract) if name.startswith("test_")]
ACCOUNTS = "test_every_pulse_and_parameter_is_accounted_for"


#: The joint moves before the pulses; much of a trial is noise.
NOT_MET = ("pre_pulse", "full_record")


def contract(estimator):
    class Contract(EstimatorContract):
        tolerance = None if estimator.name in NOT_MET else EstimatorContract.tolerance

        def make(self):
            return estimator

    return Contract()


@pytest.mark.parametrize("name", METHODS)
def test_every_method_keeps_the_contract(name):
    for check in CHECKS:
        getattr(contract(METHODS[name]), check)()


class Broken:
    """The pilot's method with another name, kinds and estimates."""

    def __init__(self, change=lambda estimates: estimates, *, name="broken", kinds=("bench",)):
        self.name, self.kinds, self._change = name, kinds, change

    def baseline_for(self, kind):
        return METHODS["pilot"].baseline_for(kind)

    def estimate(self, data, settings):
        estimates = METHODS["pilot"].estimate(data, settings)
        cells = tuple(replace(c, method=self.name) for c in estimates.cells)
        return self._change(replace(estimates, cells=cells))


def with_parameter(estimates, **changes):
    cell = estimates.cells[0]
    parameters = (replace(cell.parameters[0], **changes), *cell.parameters[1:])
    return replace(estimates, cells=(replace(cell, parameters=parameters),))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda e: replace(e, pulses=e.pulses[1:]), "once and in order"),
        (lambda e: replace(e, cells=()), "expected one or more"),
        (lambda e: replace(e, cells=(replace(e.cells[0], n_used=1),)), "n_used"),
        (lambda e: replace(e, cells=(replace(e.cells[0], method="pilot"),)), "expected method"),
        (lambda e: with_parameter(e, name="K"), "first, got"),
        (lambda e: with_parameter(e, status="good"), "expected a status"),
        (lambda e: with_parameter(e, value=None), "expected a value"),
        (lambda e: with_parameter(e, value=6.0, ci_high=7.0, ci_low=5.0), "near 60"),
    ],
)
def test_the_contract_notices_estimates_that_do_not_keep_it(change, message):
    getattr(contract(Broken()), ACCOUNTS)()
    with pytest.raises(AssertionError, match=message):
        getattr(contract(Broken(change)), ACCOUNTS)()


@pytest.mark.parametrize("wrong", [{"name": "two words"}, {"kinds": ()}, {"kinds": ("sitting",)}])
def test_the_contract_notices_a_wrong_name_or_kind(wrong):
    with pytest.raises(AssertionError, match="expected"):
        contract(Broken(**wrong)).test_it_has_a_name_and_serves_a_kind_of_study()
