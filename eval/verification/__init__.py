"""Verification: does a run's folder hold together?"""
