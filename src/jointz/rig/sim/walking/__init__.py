"""Physics of a walking person: joint, motion and plant."""
