"""The stages of the data path: one file each, none sees another; `pipeline` joins them."""
