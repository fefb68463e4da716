"""Looking at stored flights: one page that moves, or a film."""
