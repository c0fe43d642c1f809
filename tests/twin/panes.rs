//! Smooth panes, which the light of lamps without extent passes although no path finds it there.
use crate::kernels::{check, run, run_with_all_effects};
use crate::support;
use crate::twin::Workplace;
use tallow::render::{Outputs, Renderer, called_for};
use tallow::scene::Loaded;

const PANE: &str = "[[material]]\nname = 'pane'\ntype = 'metallic-roughness'\nmetallic = 0.0\nroughness = 0.0\n\
                    transmission_factor = 0.9\n";

/// Panes in the world and in instances, one of them mirrored and stretched, a bulb around a point light, one of colour on the sun's
/// way, a pane of colour, and a veil.
pub fn panes() -> Loaded {
    let workplace = Workplace::new().picture("stained.png", 4, |x, y| [255 - 40 * x as u8, 160, 60 * y as u8]);
    // The step is steep: between its texels sharp lobes, by which lamps are chosen, magnify what rounding makes of a roughness.
    let workplace = workplace.picture("rough.png", 64, |x, _| [0, if x < 32 { 20 } else { 200 }, 255]);
    let mut scene = workplace.scene(&format!(
        "[camera]\nposition = [0.0, 1.4, 5.0]\ntarget = [0.0, 0.7, 0.0]\nfov = 45.0\n[render]\nmax_depth = 4\n\
         [environment]\nradiance = 0.2\n[[light]]\ntype = 'directional'\ndirection = [0.3, -1.0, -0.4]\nirradiance = 3.0\n\
         [[light]]\ntype = 'point'\nposition = [-1.2, 0.8, 0.0]\nintensity = 4.0\n{PANE}color = 0.95\n\
         [[material]]\nname = 'red'\ntype = 'metallic-roughness'\nmetallic = 0.0\nroughness = 0.0\ntransmission_factor = 1.0\n\
         color = [0.9, 0.3, 0.3]\ncolor_texture = 'stained.png'\ntransmission_texture = 'stained.png'\n\
         [[material]]\nname = 'etched'\ntype = 'metallic-roughness'\nmetallic = 0.0\nmetallic_roughness_texture = 'rough.png'\n\
         transmission_factor = 0.8\n[[material]]\nname = 'veil'\nopacity = 0.5\n\
         [[mesh]]\nshape = 'rectangle'\ntransform = {{ rotate = [-90.0, 0.0, 0.0], scale = 4.0 }}\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'pane'\n\
         transform = {{ translate = [1.2, 1.5, 0.5], rotate = [-60.0, 0.0, 0.0], scale = 0.8 }}\n\
         [[mesh]]\nshape = 'sphere'\nmaterial = 'pane'\ntransform = {{ translate = [-1.2, 0.8, 0.0], scale = 0.4 }}\n\
         [[mesh]]\nshape = 'sphere'\nmaterial = 'red'\ntransform = {{ translate = [0.9, 0.5, -0.8], scale = 0.3 }}\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'red'\ntransform = {{ translate = [-0.3, 1.2, -1.0], rotate = [-40.0, 0.0, 0.0] }}\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'veil'\ntransform = {{ translate = [0.5, 0.6, 1.5], scale = 0.4 }}\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'etched'\ntransform = {{ translate = [-0.4, 0.8, 1.2], rotate = [-60.0, 0.0, 0.0] }}\n\
         [[mesh]]\nname = 'window'\nshape = 'rectangle'\nmaterial = 'pane'\n\
         [[instance]]\nmesh = 'window'\ntransform = {{ translate = [0.2, 1.1, 0.2], rotate = [-80.0, 10.0, 0.0], scale = 0.5 }}\n\
         [[instance]]\nmesh = 'window'\ntransform = {{ translate = [-0.8, 2.0, 1.0], rotate = [70.0, 0.0, 0.0], scale = [0.6, 1.2, -0.6] }}\n"
    ));
    crate::kernels::small(&mut scene.settings);
    scene
}

#[test]
fn panes_agree_with_their_twin() {
    let gpu = support::gpu();
    let scene = panes();
    let effects = called_for(&scene, &scene.settings, Outputs::FILTERED);
    assert!(effects.clear_walls && effects.alpha_masks);
    check("panes", &run(&gpu, &scene, effects));
    check("panes, all effects", &run_with_all_effects(&gpu, &scene));
    support::assert_silent(&gpu);
}

/// Mean of what a camera sees of the floor, 0.9 below it, by direct light: red, green and blue.
fn floor(tables: &str) -> [f64; 3] {
    floor_in(&Workplace::new(), tables)
}

fn floor_in(workplace: &Workplace, tables: &str) -> [f64; 3] {
    let gpu = support::gpu();
    let scene = workplace.scene(&format!(
        "[film]\nwidth = 64\nheight = 64\n[camera]\nposition = [0.0, 0.9, 0.0]\ntarget = [0.0, 0.0, 0.0]\nup = [0.0, 0.0, -1.0]\n\
         [render]\nspp = 64\nmax_depth = 2\n[[mesh]]\nshape = 'rectangle'\ntransform = {{ rotate = [-90.0, 0.0, 0.0], scale = 9.0 }}\n\
         {tables}"
    ));
    let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::default()).unwrap();
    let stats = support::render(&gpu, &renderer);
    support::assert_silent(&gpu);
    [0, 1, 2].map(|c| stats.iter().map(|s| f64::from(s.mean[c])).sum::<f64>() / stats.len() as f64)
}

/// Whether `lit` is the share `of` of `open`, by channel, to within `by` of it.
fn check_share(lit: [f64; 3], open: [f64; 3], of: impl Fn(usize) -> f64, by: f64, what: &str) {
    for c in 0..3 {
        assert!((lit[c] / open[c] / of(c) - 1.0).abs() < by, "{what}, channel {c}: {} of {}", lit[c] / open[c], of(c));
    }
}

/// A pane lets pass what appendix B of glTF 2.0 says: base colour times transmission times 1 - F(c), F of index 1.5, without
/// noise.
#[test]
fn sun_and_bulb_shine_through_panes() {
    let color = [0.9, 0.8, 0.6];
    let passes = |c: f64, channel: usize| color[channel] * 0.9 * (1.0 - (0.04 + 0.96 * (1.0 - c).powi(5)));
    let pane = |more: &str| format!("{PANE}{more}\n[[mesh]]\nmaterial = 'pane'\n");
    let tinted = pane(&format!("color = {color:?}"));
    let window =
        "shape = 'rectangle'\ntransform = { translate = [0.0, 2.0, 0.0], rotate = [-90.0, 0.0, 0.0], scale = 9.0 }\n";
    let two = "[[mesh]]\nmaterial = 'pane'\nshape = 'rectangle'\n\
               transform = { translate = [0.0, 2.5, 0.0], rotate = [90.0, 0.0, 0.0], scale = 9.0 }\n";
    // In their own space, rays and normals of these have other angles.
    let stretched = "moving = true\nshape = 'rectangle'\n\
                     transform = { translate = [0.0, 2.0, 0.0], rotate = [-90.0, 0.0, 0.0], scale = [9.0, 9.0, 0.3] }\n";
    let flat = "shape = 'sphere'\ntransform = { translate = [0.0, 2.0, 0.0], scale = [9.0, 0.01, 9.0] }\n";
    for degrees in [0.0f64, 60.0, 70.0] {
        let (sin, c) = degrees.to_radians().sin_cos();
        let sun = format!("[[light]]\ntype = 'directional'\nirradiance = 1.0\ndirection = [{sin:?}, {:?}, 0.0]\n", -c);
        let open = floor(&sun);
        let what = format!("{degrees} degrees");
        check_share(floor(&format!("{sun}{tinted}{window}")), open, |i| passes(c, i), 1e-4, &what);
        let both = floor(&format!("{sun}{tinted}{window}{two}"));
        check_share(both, open, |i| passes(c, i).powi(2), 1e-4, &format!("{what}, two panes"));
        let moving = floor(&format!("{sun}{tinted}{stretched}"));
        check_share(moving, open, |i| passes(c, i), 1e-4, &format!("{what}, a pane that moves"));
        let lens = floor(&format!("{sun}{tinted}{flat}"));
        check_share(lens, open, |i| passes(c, i).powi(2), 2e-3, &format!("{what}, a flat ball"));
        assert_eq!(floor(&format!("{sun}{}{window}", pane("color = 0.8\nclearcoat = 0.5"))), [0.0; 3], "a coat");
    }
    // Rays to the middle of a bulb meet it head on.
    let bulb = "shape = 'sphere'\ntransform = { translate = [0.0, 2.0, 0.0], scale = 0.5 }\n";
    let light = "[[light]]\ntype = 'point'\nposition = [0.0, 2.0, 0.0]\nintensity = 1.0\n";
    let open = floor(light);
    check_share(floor(&format!("{light}{tinted}{bulb}")), open, |i| passes(1.0, i), 1e-3, "a bulb");
    let meshed = floor(&format!("{light}{tinted}segments = 64\n{bulb}"));
    check_share(meshed, open, |i| passes(1.0, i), 2e-3, "a bulb of triangles");
    // What lies behind the lamp, or behind the floor, takes nothing from its light.
    for height in [3.0, -1.0] {
        let beyond = format!("shape = 'sphere'\ntransform = {{ translate = [0.0, {height:?}, 0.0], scale = 0.5 }}\n");
        assert_eq!(floor(&format!("{light}{tinted}{beyond}")), open, "a ball at {height}");
    }
    // Lamps and sky are found behind a pane by paths: their shadow rays stop there, or they would count twice.
    let lamp = "[[material]]\nname = 'lamp'\ncolor = 0\nemission = 1\n[[mesh]]\nshape = 'rectangle'\nmaterial = 'lamp'\n\
                transform = { translate = [0.0, 3.0, 0.0], rotate = [90.0, 0.0, 0.0], scale = 2.0 }\n";
    assert_eq!(floor(&format!("{lamp}{tinted}{window}")), [0.0; 3]);
}

/// Where a picture makes a rough pane smooth, it is as one that is smooth everywhere; elsewhere microfacets bring the light.
#[test]
fn the_picture_of_roughness_says_where_a_pane_is_clear() {
    let sun = "[[light]]\ntype = 'directional'\nirradiance = 1.0\ndirection = [0.0, -1.0, 0.0]\n";
    let pane = |roughness: f32, more: &str| {
        let pane = PANE.replace("roughness = 0.0", &format!("roughness = {roughness:?}"));
        format!(
            "{sun}{pane}{more}\n[[mesh]]\nmaterial = 'pane'\nshape = 'rectangle'\n\
             transform = {{ translate = [0.0, 2.0, 0.0], rotate = [-90.0, 0.0, 0.0], scale = 9.0 }}\n"
        )
    };
    let clear = floor(&pane(0.0, ""));
    let picture = |of: fn(u32) -> u8| Workplace::new().picture("rough.png", 64, move |x, _| [255, of(x), 255]);
    let smoothed = pane(1.0, "metallic_roughness_texture = { file = 'rough.png', filter = 'nearest' }");
    assert_eq!(floor_in(&picture(|_| 0), &smoothed), clear);
    let half = floor_in(&picture(|x| if x < 32 { 0 } else { 255 }), &smoothed)[0] / clear[0];
    assert!((half - 0.5).abs() < 0.02, "{half} of the light passes straight, and no path of two segments brings more");
}

/// Half of a window is red, half is blue; the sun shines through both onto what the camera sees.
#[test]
fn the_picture_of_a_pane_colours_what_passes() {
    let sun = "[[light]]\ntype = 'directional'\nirradiance = 1.0\ndirection = [0.0, -1.0, 0.0]\n";
    let stained = Workplace::new().picture("stained.png", 64, |x, _| if x < 32 { [255, 0, 0] } else { [0, 0, 255] });
    let window = format!(
        "{PANE}color_texture = 'stained.png'\n[[mesh]]\nmaterial = 'pane'\nshape = 'rectangle'\n\
         transform = {{ translate = [0.0, 2.0, 0.0], rotate = [-90.0, 0.0, 0.0], scale = 9.0 }}\n"
    );
    let [red, green, blue] = floor_in(&stained, &format!("{sun}{window}"));
    let open = floor(sun)[0] * 0.9 * 0.96;
    assert!((red / open - 0.5).abs() < 0.01 && (blue / open - 0.5).abs() < 0.01, "{red} and {blue} of {open}");
    assert!(green / open < 0.01, "{green} of {open}");
}
