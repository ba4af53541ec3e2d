"""Simulating a garment with fewer vertices than it has."""
