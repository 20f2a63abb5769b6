"""Signals wait while a device is stopped, whichever thread gets them."""

import os
import signal
import threading
import time

import pytest

from jointz.core.errors import DeviceError
from jointz.core.stop_signals import signals_held
from jointz.rig.experiment.session import _stop


@pytest.fixture
def heard():
    """Which of two signals were handled so far."""
    numbers = []

    def hear(number, frame):
        numbers.append(number)

    before = {number: signal.signal(number, hear) for number in (signal.SIGTERM, signal.SIGHUP)}
    yield numbers
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.fixture(params=["alone", "beside another thread"])
def threads(request):
    """Other threads, as drivers and progress bars have them: their masks hold nothing back."""
    over = threading.Event()
    others = [threading.Thread(target=over.wait)] if request.param != "alone" else []
    for other in others:
        other.start()
    yield
    over.set()
    for other in others:
        other.join()


def wait_for(heard, count):
    """Wait: a signal that another thread gets is handled in this one a little later."""
    until = time.monotonic() + 10.0
    while len(heard) < count and time.monotonic() < until:
        time.sleep(0.01)


@pytest.mark.usefixtures("threads")
def test_a_signal_waits_for_the_end_of_the_block(heard):
    with signals_held():
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(0.05)
        assert heard == []
    wait_for(heard, 1)
    assert heard == [signal.SIGTERM]


@pytest.mark.usefixtures("threads")
def test_handlers_are_as_they_were_after_an_error(heard):
    def fail():
        with signals_held():
            os.kill(os.getpid(), signal.SIGTERM)
            raise ZeroDivisionError

    before = signal.getsignal(signal.SIGTERM)
    with pytest.raises(ZeroDivisionError):
        fail()
    assert signal.getsignal(signal.SIGTERM) is before
    wait_for(heard, 1)
    os.kill(os.getpid(), signal.SIGHUP)
    wait_for(heard, 2)
    assert heard == [signal.SIGTERM, signal.SIGHUP]


@pytest.mark.usefixtures("threads")
def test_what_is_ignored_is_ignored_in_the_block_too(heard):
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    with signals_held():
        os.kill(os.getpid(), signal.SIGHUP)
        assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    assert heard == []


def test_a_thread_that_handles_no_signals_may_hold_them():
    done = []

    def hold():
        with signals_held():
            done.append(True)

    thread = threading.Thread(target=hold)
    thread.start()
    thread.join()
    assert done == [True]


def test_a_signal_during_the_stop_of_a_device_hides_no_device_that_does_not_stop():
    class Interrupted(BaseException):
        pass

    def interrupt(number, frame):
        raise Interrupted

    class Stuck:
        def stop(self):
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(0.5)  # another thread of a busy process may get it some time later
            raise RuntimeError("bus is gone")

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        told = r"actuator: could not be stopped \(RuntimeError: bus is gone\). Switch its power off"
        with pytest.raises(DeviceError, match=told):
            _stop("actuator", Stuck(), {"actuator"}, None, None, None)
    finally:
        signal.signal(signal.SIGTERM, before)
