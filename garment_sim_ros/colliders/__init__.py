"""From a body to colliders: fitting, segmentation and the JSON description."""
