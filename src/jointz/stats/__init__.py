"""Statistics over estimates; every statistic says what its rows are."""
