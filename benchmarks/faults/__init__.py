"""Fault injection: runs killed at random moments, and checks of what they leave."""
