"""Whether garments stay worn: clips x bodies x outfits, by the measures of `pierced` and `inside`.

    python bench/worn.py [--clip F ...] [--body F ...] [--outfit F ...] [--seconds 6] [--json F]

Simulated offline at 60 frames/s, so without overload. Bodies, clips and meshes of the shared data
are taken where they are; see `--help`.
"""
