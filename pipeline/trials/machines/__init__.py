"""The trial on other machines: made records of slides, drives, gearboxes and wheels, and what is found in them."""
