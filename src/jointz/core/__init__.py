"""Recordings, studies, protocols, gait phases, codes, errors and limits, which all layers share."""
