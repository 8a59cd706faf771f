"""Substructures meet: joints, receptance coupling, assembly."""
