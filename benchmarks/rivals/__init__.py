"""Other libraries behind the interface of our side: OpenCV, filterpy, and methods of the literature."""
