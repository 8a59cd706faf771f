"""Modes and joint from cross FRFs: model, misfit, priors, search, polish, order, posterior."""
