"""Substructure A: tool and holder as Timoshenko beams with a distributed contact."""
