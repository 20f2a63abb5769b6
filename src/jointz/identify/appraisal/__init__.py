"""How far a study's numbers depend on choices of the analysis: specification curve."""
