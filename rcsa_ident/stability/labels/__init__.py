"""Tested cuts teach: noise of labels, posterior, next test."""
