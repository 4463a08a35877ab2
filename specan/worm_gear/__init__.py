"""The worm gear: losses of tooth engagement, bearings and oil, and what instruments indicate of them."""
