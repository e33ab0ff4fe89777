"""IMUs: the seam `ImuSource`, the kinds of sensors behind it, and the fusion of their samples."""
