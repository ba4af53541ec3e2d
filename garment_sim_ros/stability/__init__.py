"""The extremes: scenes, judge and map."""
