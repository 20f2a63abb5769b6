"""How far a study's numbers can be trusted: certificate and specification curve."""
