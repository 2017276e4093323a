"""Back ends that make poses and maps of what front ends detect."""
