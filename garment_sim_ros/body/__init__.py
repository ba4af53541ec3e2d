"""The avatar's body: rig and skin, their loaders, kinematics, skinning and retargeting."""
