"""Plans beside what studies of realistic people then gave."""
