"""The studio: a local web page on which people look at scenarios, drive the robot and judge demonstrations."""
