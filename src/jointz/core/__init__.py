"""The vocabulary of the house: recordings, studies, gait phases, results, errors."""
