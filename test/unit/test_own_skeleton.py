"""A body that is moved by the skeleton that it has itself."""

import numpy as np
from unit.test_retargeting import body_of, person, rig_of

from garment_sim_ros.body.anatomy import SourceReference
from garment_sim_ros.body.kinematics import ForwardKinematics
from garment_sim_ros.body.retargeting import Retargeter


def test_the_same_skeleton_turns_alike_whatever_is_told_of_its_hinges():
    """About its bones, too: nothing that is guessed from its motion comes between."""
    source, target = rig_of(person("hanging")), body_of(person("hanging"))
    told = SourceReference(hinges={"leftUpperArm": np.array([0.5, -np.sqrt(0.75), 0.0])})
    q = np.zeros(len(source.dofs))
    q[3:] = np.random.default_rng(2).normal(0.0, 0.3, len(q) - 3)
    T = Retargeter(source, target, reference=told).world_joints(q)
    wanted = ForwardKinematics(source).from_dofs(q)
    for name in ("hips", "leftUpperArm", "leftLowerArm", "leftHand", "head", "rightFoot"):
        np.testing.assert_allclose(
            T[target.rig.index(name), :3, :3], wanted[source.index(name), :3, :3], atol=1e-9
        )
