"""Recordings with one planted mistake each: which of them end as an `ok` estimate that is wrong?

``python -m benchmarks.planted_errors --out FOLDER [--only NAME...] [--cases planted|clean]
[--code PATH]``. Physics, mistakes and files are made here with numpy and scipy alone, and
whoever wrote them had not read the estimators; the program is run by its command line, two
cases at once. ``scores.csv`` has one row a quantity, ``summary.txt`` the counts.
``--code PATH`` puts another version's ``src`` first on PYTHONPATH.

Cases ``strapped`` came later, with the method of this name and knowledge of it: the walkers are
those of :mod:`jointz.rig.sim`, the mistakes the same and those of the benches. Cases ``walking``
have a rigidly coupled device, and say so.

Bench cases go through ``analyze`` with ``kind = "bench"``: the code that this was written on has
no command ``identify bench``. ``analyze`` has no option that turns the certificate off.

Written before the first run. A mistake is planted only where the files hold evidence of it:
commands of several sizes where the torque was clipped, a pulse table or a body mass where the rate
is wrong, a command beside a torque of the wrong gain. Four cases have weak evidence, so that an
`ok` that is off is no surprise there:

1. ``bench_rate_double``: inertia of a leg of known mass and height is all that tells the rate.
2. ``walking_mass_lb``: a heavy body is possible; K, B, J are right and only values per kg are off.
3. ``bench_clip_applied``: that responses are not in proportion tells of a clipped motor *or* of a
   joint that stiffens.
4. ``walking_clip_applied``: the same, beneath the variability of strides.

Never planted, as nothing reveals them: a gain of torque or angle of 1.5, another rate than
declared where neither table nor body is known, a mass that is 10 % off.
"""
