"""The hallway of section 4.2: two avatars pass each other, and four cameras with limits follow them by a strategy."""
