"""Particles against shapes: packing, broad phase, distance, sides, sweep, response, friction."""
