"""The experiment at run time: loop, gait phase, schedule, safety, recorder, session."""
