"""Registration of the images themselves, colour and depth, where there are too few keypoints."""
