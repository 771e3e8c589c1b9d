// Starts the parts once index.js is there, or has failed to load.
scanshade.begin();
