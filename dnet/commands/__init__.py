"""The commands of `dnet`: a frozen dataclass each, whose fields are the options."""
