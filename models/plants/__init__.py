"""The mechanics that carry a sensor."""
