//! Smooth panes without colour, which the light of lamps without extent passes although no path finds it there.
use crate::kernels::{check, run};
use crate::support;
use crate::twin::Workplace;
use tallow::render::{Outputs, Renderer, all_effects, called_for};
use tallow::scene::Loaded;

const PANE: &str = "[[material]]\nname = 'pane'\ntype = 'metallic-roughness'\nmetallic = 0.0\nroughness = 0.0\n\
                    transmission_factor = 0.9\n";

/// Panes in the world and in instances, one of them mirrored and stretched, a bulb around a point light, a pane of colour, and a veil.
pub fn panes() -> Loaded {
    let mut scene = Workplace::new().scene(&format!(
        "[camera]\nposition = [0.0, 1.4, 5.0]\ntarget = [0.0, 0.7, 0.0]\nfov = 45.0\n[render]\nmax_depth = 4\n\
         [environment]\nradiance = 0.2\n[[light]]\ntype = 'directional'\ndirection = [0.3, -1.0, -0.4]\nirradiance = 3.0\n\
         [[light]]\ntype = 'point'\nposition = [-1.2, 0.8, 0.0]\nintensity = 4.0\n{PANE}color = 0.95\n\
         [[material]]\nname = 'red'\ntype = 'metallic-roughness'\nmetallic = 0.0\nroughness = 0.0\ntransmission_factor = 1.0\n\
         color = [0.9, 0.3, 0.3]\n[[material]]\nname = 'veil'\nopacity = 0.5\n\
         [[mesh]]\nshape = 'rectangle'\ntransform = {{ rotate = [-90.0, 0.0, 0.0], scale = 4.0 }}\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'pane'\n\
         transform = {{ translate = [1.2, 1.5, 0.5], rotate = [-60.0, 0.0, 0.0], scale = 0.8 }}\n\
         [[mesh]]\nshape = 'sphere'\nmaterial = 'pane'\ntransform = {{ translate = [-1.2, 0.8, 0.0], scale = 0.4 }}\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'red'\ntransform = {{ translate = [-0.3, 1.2, -1.0], rotate = [-40.0, 0.0, 0.0] }}\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'veil'\ntransform = {{ translate = [0.5, 0.6, 1.5], scale = 0.4 }}\n\
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
    let outputs = Outputs { split_light: true, guides: true, counters: false };
    let scene = panes();
    let effects = called_for(&scene, &scene.settings, outputs);
    assert!(effects.clear_walls && effects.alpha_masks);
    check("panes", &run(&gpu, &scene, effects));
    check("panes, all effects", &run(&gpu, &scene, all_effects(&scene, &scene.settings)));
    support::assert_silent(&gpu);
}

/// Mean of what a camera sees of the floor, 0.9 below it, by direct light.
fn floor(tables: &str) -> f64 {
    let gpu = support::gpu();
    let scene = Workplace::new().scene(&format!(
        "[film]\nwidth = 64\nheight = 64\n[camera]\nposition = [0.0, 0.9, 0.0]\ntarget = [0.0, 0.0, 0.0]\nup = [0.0, 0.0, -1.0]\n\
         [render]\nspp = 64\nmax_depth = 2\n[[mesh]]\nshape = 'rectangle'\ntransform = {{ rotate = [-90.0, 0.0, 0.0], scale = 9.0 }}\n\
         {tables}"
    ));
    let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::default()).unwrap();
    let stats = support::render(&gpu, &renderer);
    support::assert_silent(&gpu);
    stats.iter().map(|s| f64::from(s.mean[1])).sum::<f64>() / stats.len() as f64
}

/// A pane lets pass what appendix B of glTF 2.0 says: base colour times transmission times 1 - F(c), F of index 1.5. The standard error
/// is less than .1 % of the mean.
#[test]
fn sun_and_bulb_shine_through_panes() {
    let passes = |c: f64| 0.8 * 0.9 * (1.0 - (0.04 + 0.96 * (1.0 - c).powi(5)));
    let pane = |more: &str| format!("{PANE}{more}\n[[mesh]]\nmaterial = 'pane'\n");
    let window =
        "shape = 'rectangle'\ntransform = { translate = [0.0, 2.0, 0.0], rotate = [-90.0, 0.0, 0.0], scale = 9.0 }\n";
    let two = "[[mesh]]\nmaterial = 'pane'\nshape = 'rectangle'\n\
               transform = { translate = [0.0, 2.5, 0.0], rotate = [90.0, 0.0, 0.0], scale = 9.0 }\n";
    for degrees in [0.0f64, 60.0, 70.0] {
        let (sin, c) = degrees.to_radians().sin_cos();
        let sun = format!("[[light]]\ntype = 'directional'\nirradiance = 1.0\ndirection = [{sin:?}, {:?}, 0.0]\n", -c);
        let [open, one] = [floor(&sun), floor(&format!("{sun}{}{window}", pane("color = 0.8")))];
        assert!((one / open / passes(c) - 1.0).abs() < 0.005, "{degrees} degrees: {} of {}", one / open, passes(c));
        let both = floor(&format!("{sun}{}{window}{two}", pane("color = 0.8")));
        assert!((both / open / passes(c).powi(2) - 1.0).abs() < 0.01, "{degrees} degrees: {} through two", both / open);
        for stops in ["color = [0.8, 0.7, 0.8]", "color = 0.8\nclearcoat = 0.5"] {
            assert_eq!(floor(&format!("{sun}{}{window}", pane(stops))), 0.0, "{stops}");
        }
    }
    // Rays to the middle of a bulb meet it head on.
    let bulb = "shape = 'sphere'\ntransform = { translate = [0.0, 2.0, 0.0], scale = 0.5 }\n";
    let light = "[[light]]\ntype = 'point'\nposition = [0.0, 2.0, 0.0]\nintensity = 1.0\n";
    let [open, one] = [floor(light), floor(&format!("{light}{}{bulb}", pane("color = 0.8")))];
    assert!((one / open / passes(1.0) - 1.0).abs() < 0.005, "a bulb: {}", one / open);
    let meshed = floor(&format!("{light}{}segments = 64\n{bulb}", pane("color = 0.8")));
    assert!((meshed / open / passes(1.0) - 1.0).abs() < 0.006, "a bulb of triangles: {}", meshed / open);
    // Lamps and sky are found behind a pane by paths: their shadow rays stop there, or they would count twice.
    let lamp = "[[material]]\nname = 'lamp'\ncolor = 0\nemission = 1\n[[mesh]]\nshape = 'rectangle'\nmaterial = 'lamp'\n\
                transform = { translate = [0.0, 3.0, 0.0], rotate = [90.0, 0.0, 0.0], scale = 2.0 }\n";
    assert_eq!(floor(&format!("{lamp}{}{window}", pane("color = 0.8"))), 0.0);
}
