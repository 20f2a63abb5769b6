"""Attacks on `strapped`: studies of walking people with one planted error, and what comes out.

``python -m benchmarks.attacks --out DIR [--people 6] [--seed 1] [--only NAME ...] [--code SRC]``
simulates people once, writes a study a case, runs ``jointz analyze`` on it and prints a table.
``--only`` takes names or their beginnings; ``--code`` puts another version's ``src`` first on
PYTHONPATH. Needs MuJoCo (dependency group ``worlds``). The author had not read the estimators.

People, gait, pulses, sensors and calibration are those of :mod:`benchmarks.worlds`. The response
to a pulse is not: there the muscles yield and no K, B and J describe the leg, so that all is
undecided and no attack could succeed. Here (:mod:`benchmarks.attacks.people`) a joint with K, B
and J answers, which a strap couples to the device.
"""
