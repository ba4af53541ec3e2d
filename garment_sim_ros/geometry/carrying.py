"""Points carried by several transforms, each by a share: linear blending."""

from garment_sim_ros.jit import kernel


@kernel()
def carry(x, frame, weight, T, x_world):
    """Carries points by their frames.

    Args:
        x: Points, shape [v, 3].
        frame: Frames that carry each, shape [v, s].
        weight: By which share; what is 0 is not looked at, shape [v, s].
        T: Transforms of the frames, shape [b, 4, 4].
        x_world: Output: where the points are, shape [v, 3].
    """
    for v in range(x.shape[0]):
        for k in range(3):
            x_world[v, k] = 0.0
        for s in range(frame.shape[1]):
            b, share = frame[v, s], weight[v, s]
            if share != 0.0:
                for k in range(3):
                    x_world[v, k] += share * (
                        T[b, k, 0] * x[v, 0]
                        + T[b, k, 1] * x[v, 1]
                        + T[b, k, 2] * x[v, 2]
                        + T[b, k, 3]
                    )
