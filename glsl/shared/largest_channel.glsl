float largest_channel(vec3 c) { return max(c.r, max(c.g, c.b)); }
