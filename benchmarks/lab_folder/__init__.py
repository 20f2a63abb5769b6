"""Acceptance check of studies with two clocks, on simulated people whose K, B and J are known.

``python -m benchmarks.lab_folder --out DIR`` simulates a lab's recordings of two people a seed,
writes them in several forms with a ``study.toml`` each, runs ``jointz analyze`` as a subprocess and
scores the estimates. The package imports nothing of jointz: the joint is linear at each timing
point and knows no estimator. Forms:

- ``mat``: struct array of trials; angle at 240 Hz, current at 1 kHz, heel strikes as times, trigger
- ``csv``: ``mocap.csv`` joined to ``daq.csv``, heel strikes in a table of their own
- ``c3d``: angle as a point at 200 Hz, current and trigger as analogs at 1 kHz, strikes as events
- ``one_clock``: reference; the angle at 1 kHz on the clock of the current, pulses in a table
- ``slow_angle``: reference; angle, current and trigger on one clock of 240 Hz

K and B differ between timing points, so that pulses of a wrong point give wrong estimates. In the
folder, ``table.csv`` is the printed table, ``rows.csv`` has each cell (``--planted``: each error
with the messages of jointz), and ``SEED/FORM.log`` what the program printed.

``--planted`` writes the form ``mat`` with one error at a time. ``--shared FOLDER`` scores the
recordings of another generator, ``FOLDER/lab_folder/make.py``, in the same way.
"""
