"""Files as other labs' software writes them, and what jointz makes of each.

Thirty files hold the same simulated walk in the encodings, units, clocks and layouts of other
programs. Of each, the draft of ``jointz inspect`` is read unedited and compared with the truth.

A second set of thirty, with ``--set second``, has other programs and eight folders of
recordings; it was written without a look at the reader. So was a third, ``--set third``: four
each of encodings, delimiters, clocks, headers, units, languages and sampling, and two hopeless.

Run ``python -m benchmarks.awkward_files``, for some of them with ``--only NAME``.
"""
