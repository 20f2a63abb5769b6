"""From a measured impedance to a controller: profiles, their files, and controllers to run."""
