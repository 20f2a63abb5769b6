"""Analysis of a study: estimates, means, report and the folder of results (``jointz analyze``)."""
