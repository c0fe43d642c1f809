// Choice of one of many lights by a tree over them: from its root on, one of the children of a node is chosen by about what the lights
// below each bring (Conty Estevez and Kulla 2018). Unlike there, no node is split, a node has several children, so that few steps depend on
// large groups, and cosines are means, not bounds, by which half of a ball that shines would be chosen in vain.

const uint CHILDREN = 4u; // of a node

const float UNIT_STEP = 5.9604644775390625e-8; // between the numbers that unit_interval returns

const float WORD = 2.3283064365386963e-10; // probability of one of all words

// What bounds may lose by rounding, so that nothing that brings light is passed over: cosines of differences of angles come out of square
// roots.
const float COSINE_SLACK = 5e-4;

// What a mean over a group says is nothing may be little: no light is passed over for that.
const float LEAST_COSINES = 1e-6;

// About the mean of the cosine between a direction and those of a group, where negative ones count as 0. `cosine` is that of the direction and
// the mean of the group, whose length is `m`. It is exact for a group that fills a hemisphere or all directions evenly, or has but one, and
// up to .03 off for other caps, as long as `share` is 1: that of the spread around the mean which is along the direction.
float mean_cosine(float cosine, float m, float share) {
    float along = m * cosine;
    float spread = mix(min(0.6 * (1.0 - m), 0.25), max(0.25 - 0.5 * m, 0.0), cosine * cosine);
    return 0.5 * (along + sqrt(along * along + share * spread));
}

// About what the lights below a node bring to a receiver, up to a factor that all nodes have; 0 only if they bring nothing.
float brought_by(LightNode node, Receiver r) {
    vec3 to_node = node.centre - r.position, axis = octahedral_decode(node.axis);
    float centre2 = dot(to_node, to_node), inverse = inversesqrt(max(centre2, 1e-30));
    vec3 w = to_node * inverse;
    // The lights are seen in a cone around `w`, all round from among them: sine and cosine of half its angle.
    float within = min(node.radius * inverse, 1e15), seen = sqrt(max(1.0 - within * within, 0.0));
    float slack = COSINE_SLACK * (1.0 + within);
    // Length of the mean of the directions to them: those to a ball seen from outside fill a cap.
    float towards = within < 1.0 ? 0.5 + 0.5 * seen : 0.5 / within;
    vec2 beams = unpackSnorm2x16(node.beams);
    float cosine = dot(r.normal, w), beam = -dot(axis, w), tilt = dot(r.normal, axis);
    bool in_a_plane = FX_EMISSIVE && beams.y < 0.0, both_sides = FX_TWO_SIDED_LAMPS && in_a_plane && beams.x < -0.5;
    float share = in_a_plane ? max(1.0 - tilt * tilt, 0.0) : 1.0;
    float arrives = mean_cosine(cosine, towards, share);
    if (r.lets_light_through) arrives += mean_cosine(-cosine, towards, share);
    bool faced = r.lets_light_through || cosine > -within * sqrt(share) - slack;
    float nearest = beam >= seen ? 1.0 : beam * seen + sqrt(max(1.0 - beam * beam, 0.0)) * within;
    bool lit = both_sides || (in_a_plane ? beam > -slack : within >= 1.0 || nearest > beams.x - slack);
    float m = (in_a_plane ? 1.0 : beams.y) * towards, emits = mean_cosine(beam, m, 1.0);
    if (both_sides) emits = 0.5 * (emits + mean_cosine(-beam, m, 1.0));
    if (FX_SPOT && (node.child & LIGHT_LEAF) != 0u) {
        Light light = Light_load(lights, node.child & ~LIGHT_LEAF);
        if (light.kind == LIGHT_SPOT) emits *= spot_share(light, w);
    }
    float reflects = arrives + r.odds_beyond_cosine;
    if (FX_ROUGH) reflects += odds_of_lobe(r, w, 0.5 - 0.5 * seen);
    float brings = max(emits * reflects, LEAST_COSINES) * node.power;
    return faced && lit ? min(brings / max(max(centre2, 0.25 * node.radius * node.radius), 1e-30), MAX_ODDS) : 0.0;
}

// The light that `u` chooses. Multiplies `probability` by that of the choice, which is 0 if no light brings anything. `bits` fill up what
// each step takes of the digits of `u`.
uint choose_by_tree(Receiver r, float u, uint bits, inout float probability) {
    uint at = LightNode_child(light_nodes, 0u);
    float by_odds = 1.0 - EVEN_SHARE; // the probability that odds decide, given the steps so far
    bool ends;
    do {
        uint next = 0u;
        uint children[CHILDREN];
        float brings[CHILDREN], sum = 0.0, number = 0.0;
        for (uint i = 0u; i < CHILDREN; i++) {
            LightNode node = LightNode_load(light_nodes, at + i);
            children[i] = node.child;
            brings[i] = brought_by(node, r);
            sum += brings[i];
            number += brings[i] > 0.0 ? 1.0 : 0.0;
        }
        float before = 0.0, start = 0.0, share = 0.0, odds_here = 0.0;
        for (uint i = 0u; i < CHILDREN; i++) {
            float odds = brings[i] > 0.0 ? brings[i] / sum : 0.0;
            float part = brings[i] > 0.0 ? mix(1.0 / number, odds, by_odds) : 0.0;
            if (part > 0.0 && u >= before) { // in the end the last, if rounding leaves something
                next = children[i];
                start = before;
                share = part;
                odds_here = odds;
            }
            before += part;
        }
        ends = next <= at || (next & LIGHT_LEAF) != 0u; // children lie behind their parents, so that every way ends
        at = next;
        probability *= share;
        by_odds = min(by_odds * odds_here / share, 1.0);
        u = min((u - start + UNIT_STEP * unit_interval(bits)) / share, BELOW_ONE);
        bits = pcg(bits);
    } while (!ends);
    return at & ~LIGHT_LEAF;
}

// The light that `word` chooses: one outside of the tree by its probability, or one of the tree, for which `probability` becomes that of the
// choice. It is 0 if no light can bring anything. Replaces `word` by its position within what chooses a light outside. Those have the last
// of all words, in whole numbers of them: by 24 bits, one of a small probability would be chosen too often, too seldom or never.
uint choose_light(Receiver r, inout uint word, out float probability, inout KeyLight key) {
    uint hash = pcg(word), end = LightNode_child(light_nodes, 0u), light = 0u, rest = word;
    uint place = ~word, begin = 0u;
    float by_tree = LightNode_power(light_nodes, 0u);
    probability = 0.0;
    for (uint i = 1u; i < end; i++) {
        LightNode outside = LightNode_load(light_nodes, i);
        uint words = min(uint(min(outside.power, BELOW_ONE) * 4294967296.0), ~begin);
        if (words > 0u && place >= begin) { // in the end the last, if rounding leaves something and there is no tree
            light = outside.child & ~LIGHT_LEAF;
            probability = float(words) * WORD;
            rest = word_of_unit((float(place - begin) + unit_interval(hash)) / float(words), hash);
        }
        begin += words;
        uint beside = outside.child & ~LIGHT_LEAF;
        if (FX_SOFT && !FX_WEIGHED_LIGHTS && is_directional(Light_kind(lights, beside))) consider(key, beside, float(words) * WORD);
    }
    key.rival = 0.0; // they are chosen as often everywhere, so that none takes another's place elsewhere
    if (by_tree > 0.0 && place >= begin) {
        float digits = UNIT_STEP * unit_interval(hash); // below those of the word, in place of those that the choice uses up
        probability = begin > 0u ? float(0u - begin) * WORD : by_tree;
        return choose_by_tree(r, min((unit_interval(word) + digits) / probability, BELOW_ONE), pcg(hash), probability);
    }
    word = rest;
    return light;
}

// Solid angle in steradians beyond which a lamp does not count as chosen more often: the tree does not choose it so, since all lamps that are
// as near bring as much. Else lamps that stand on a floor had up to three times the noise there, and a closed box of 12 emitting
// triangles had seven times as much.
const float LARGEST_SEEN = 0.25;

// The density per solid angle that MIS takes for a point of a lamp of the tree, which is seen under `solid_angle` from `p` and has this
// `density` over area by the table: as if the lamp were chosen by what it sends to `p` beside what all lamps do from the middle of
// them, half as much as if they faced `p`. The true one is not known where a path meets the lamp; any will do that is the same however
// a point of a lamp is found.
float nominal_pdf(float density, float solid_angle, vec3 p) {
    LightNode all = LightNode_load(light_nodes, 0u);
    vec3 to_all = all.centre - p;
    float others = 0.5 * all.power / max(max(dot(to_all, to_all), all.radius * all.radius), 1e-30);
    float own = density * min(solid_angle, LARGEST_SEEN);
    return all.power * own / max((own + others) * solid_angle, 1e-37);
}
