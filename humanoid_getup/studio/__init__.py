"""The studio: a page in the browser on which rises are posed, planned, bent and examined."""
