// Closures at one point, for tests: set up by a node's name and inputs, evaluated and sampled over arrays.
#include "luch/bsdf/bsdf.h"

#include <functional>
#include <map>
#include <stdexcept>
#include <string>

#include "bindings/bind.h"
#include "luch/bsdf/setup.h"
#include "luch/bsdf/setup_hair.h"

namespace luch::bindings {
namespace {

using Floats = py::array_t<float, py::array::c_style | py::array::forcecast>;

Vec3 vec3_of(const py::handle& value) {
    if (py::isinstance<py::float_>(value) || py::isinstance<py::int_>(value)) return make_vec3(value.cast<float>());
    auto s = value.cast<py::sequence>();
    if (s.size() != 3) throw std::invalid_argument("a vector has 3 numbers; this one has " + std::to_string(s.size()));
    return {s[0].cast<float>(), s[1].cast<float>(), s[2].cast<float>()};
}

// Reads inputs by name and remembers which names exist, so that a misspelt one is an error.
class Inputs {
 public:
    explicit Inputs(const py::dict& values) : values_(values) {}
    // After the last read: throws std::invalid_argument that names an input which nobody asked for.
    void refuse_unknown() const {
        for (auto [key, value] : values_)
            if (!known_.count(key.cast<std::string>()))
                throw std::invalid_argument("closure has no input " + key.cast<std::string>());
    }
    void read(const char* name, float& to) {
        get(name, [&](py::handle v) { to = v.cast<float>(); });
    }
    void read(const char* name, bool& to) {
        get(name, [&](py::handle v) { to = v.cast<bool>(); });
    }
    void read(const char* name, Vec3& to) {
        get(name, [&](py::handle v) { to = vec3_of(v); });
    }
    void read(const char* name, Microfacets& to) {
        static const std::map<std::string, Microfacets> names = {{"GGX", Microfacets::GGX},
                                                                 {"BECKMANN", Microfacets::BECKMANN},
                                                                 {"MULTI_GGX", Microfacets::MULTI_GGX},
                                                                 {"ASHIKHMIN_SHIRLEY", Microfacets::ASHIKHMIN_SHIRLEY}};
        get(name, [&](py::handle v) { to = names.at(v.cast<std::string>()); });
    }

 private:
    template <class F>
    void get(const char* name, F use) {
        known_[name] = true;
        if (values_.contains(name)) use(values_[name]);
    }
    py::dict values_;
    std::map<std::string, bool> known_;
};

struct Closures {
    ClosureSet set;
    SetupContext context;
};

using Setup = std::function<void(ClosureSet&, Color, Inputs&, const SetupContext&)>;

struct SimpleInputs {
    Color color = {1.0f, 1.0f, 1.0f};
    float roughness = 0.0f, strength = 1.0f;
    Vec3 normal = {};
};
SimpleInputs read_simple(Inputs& in) {
    SimpleInputs s;
    in.read("color", s.color);
    in.read("roughness", s.roughness);
    in.read("strength", s.strength);
    in.read("normal", s.normal);
    return s;
}

template <class Params>
void read_microfacets(Inputs& in, Params& p) {
    in.read("roughness", p.roughness);
    in.read("normal", p.normal);
    in.read("distribution", p.distribution);
}
template <class Params>
void read_tangent(Inputs& in, Params& p) {
    in.read("anisotropy", p.anisotropy);
    in.read("rotation", p.rotation);
    in.read("tangent", p.tangent);
}
template <class Params>
void read_film(Inputs& in, Params& p) {
    in.read("thin_film_thickness", p.thin_film_thickness);
    in.read("thin_film_ior", p.thin_film_ior);
}

void set_up_principled(ClosureSet& set, Color weight, Inputs& in, const SetupContext& c) {
    PrincipledParams p;
    in.read("base_color", p.base_color);
    in.read("metallic", p.metallic);
    in.read("roughness", p.roughness);
    in.read("ior", p.ior);
    in.read("alpha", p.alpha);
    in.read("thin_wall", p.thin_wall);
    in.read("normal", p.normal);
    in.read("diffuse_roughness", p.diffuse_roughness);
    in.read("subsurface_weight", p.subsurface_weight);
    in.read("subsurface_anisotropy", p.subsurface_anisotropy);
    in.read("specular_ior_level", p.specular_ior_level);
    in.read("specular_tint", p.specular_tint);
    in.read("anisotropic", p.anisotropic);
    in.read("anisotropic_rotation", p.anisotropic_rotation);
    in.read("tangent", p.tangent);
    in.read("transmission_weight", p.transmission_weight);
    in.read("coat_weight", p.coat_weight);
    in.read("coat_roughness", p.coat_roughness);
    in.read("coat_ior", p.coat_ior);
    in.read("coat_tint", p.coat_tint);
    in.read("coat_normal", p.coat_normal);
    in.read("sheen_weight", p.sheen_weight);
    in.read("sheen_roughness", p.sheen_roughness);
    in.read("sheen_tint", p.sheen_tint);
    in.read("emission_color", p.emission_color);
    in.read("emission_strength", p.emission_strength);
    in.read("multiple_scattering", p.multiple_scattering);
    read_film(in, p);
    setup_principled(set, weight, p, c);
}

void set_up_principled_hair(ClosureSet& set, Color w, Inputs& in, const SetupContext& c) {
    PrincipledHairParams p;
    bool melanin = false;
    FibreSurface surface = {c.n, {1.0f, 0.0f, 0.0f}};
    in.read("pigments", melanin);
    in.read("melanin", p.melanin);
    in.read("melanin_redness", p.melanin_redness);
    in.read("absorption", p.absorption);
    in.read("roughness", p.roughness);
    in.read("radial_roughness", p.radial_roughness);
    in.read("coat", p.coat);
    in.read("ior", p.ior);
    in.read("offset", p.offset);
    in.read("tangent", surface.tangent);
    p.parametrization = melanin ? HairColor::MELANIN : HairColor::ABSORPTION;
    setup_principled_hair(set, w, p, surface, c);
}

void set_up_hair(ClosureSet& set, Color w, Inputs& in, const SetupContext& c) {
    bool transmission = false;
    float offset = 0.0f, along = 0.1f, around = 1.0f;
    Vec3 tangent = {1.0f, 0.0f, 0.0f};
    in.read("transmission", transmission);
    in.read("offset", offset);
    in.read("roughness_along", along);
    in.read("roughness_around", around);
    in.read("tangent", tangent);
    setup_hair(set, w, transmission, offset, along, around, tangent, c);
}

const std::map<std::string, Setup>& setups() {
    using Set = ClosureSet&;
    using Context = const SetupContext&;
    static const std::map<std::string, Setup> table = {
        {"diffuse",
         [](Set set, Color w, Inputs& in, Context c) {
             auto s = read_simple(in);
             setup_diffuse(set, w, s.color, s.roughness, s.normal, c);
         }},
        {"toon",
         [](Set set, Color w, Inputs& in, Context c) {
             float size = 0.5f, smooth = 0.0f;
             bool glossy = false;
             in.read("size", size);
             in.read("smooth", smooth);
             in.read("glossy", glossy);
             auto s = read_simple(in);
             setup_toon(set, w, s.color, size, smooth, glossy, s.normal, c);
         }},
        {"translucent",
         [](Set set, Color w, Inputs& in, Context c) {
             auto s = read_simple(in);
             setup_translucent(set, w, s.color, s.normal, c);
         }},
        {"transparent",
         [](Set set, Color w, Inputs& in, Context) { setup_transparent(set, w, read_simple(in).color); }},
        {"emission",
         [](Set set, Color w, Inputs& in, Context) {
             auto s = read_simple(in);
             setup_emission(set, w, s.color, s.strength);
         }},
        {"holdout", [](Set set, Color w, Inputs&, Context) { setup_holdout(set, w); }},
        {"sheen",
         [](Set set, Color w, Inputs& in, Context c) {
             auto s = read_simple(in);
             setup_sheen(set, w, s.color, s.roughness, s.normal, c);
         }},
        {"velvet",
         [](Set set, Color w, Inputs& in, Context c) {
             auto s = read_simple(in);
             setup_velvet(set, w, s.color, s.roughness, s.normal, c);
         }},
        {"glossy",
         [](Set set, Color w, Inputs& in, Context c) {
             GlossyParams p;
             in.read("color", p.color);
             read_microfacets(in, p);
             read_tangent(in, p);
             setup_glossy(set, w, p, c);
         }},
        {"metallic",
         [](Set set, Color w, Inputs& in, Context c) {
             MetallicParams p;
             in.read("physical", p.physical);
             in.read("base_color", p.base_color);
             in.read("edge_tint", p.edge_tint);
             in.read("ior", p.ior);
             in.read("extinction", p.extinction);
             read_microfacets(in, p);
             read_tangent(in, p);
             read_film(in, p);
             setup_metallic(set, w, p, c);
         }},
        {"glass",
         [](Set set, Color w, Inputs& in, Context c) {
             GlassParams p;
             in.read("color", p.color);
             in.read("ior", p.ior);
             read_microfacets(in, p);
             read_film(in, p);
             setup_glass(set, w, p, c);
         }},
        {"refraction",
         [](Set set, Color w, Inputs& in, Context c) {
             RefractionParams p;
             in.read("color", p.color);
             in.read("ior", p.ior);
             read_microfacets(in, p);
             setup_refraction(set, w, p, c);
         }},
        {"principled", set_up_principled},
        {"principled_hair", set_up_principled_hair},
        {"hair", set_up_hair},
    };
    return table;
}

Closures make_closures(const std::string& node, const py::dict& inputs, py::object wo, py::object n, py::object ng,
                       u32 path_flags, bool caustics_reflective, bool caustics_refractive, bool bump_correction) {
    auto found = setups().find(node);
    if (found == setups().end()) throw std::invalid_argument("no closure is called " + node);
    Closures out;
    out.context = {vec3_of(n),          vec3_of(ng),         normalize(vec3_of(wo)), path_flags,
                   caustics_reflective, caustics_refractive, bump_correction};
    clear_closures(out.set);
    Inputs in(inputs);
    found->second(out.set, make_vec3(1.0f), in, out.context);
    in.refuse_unknown();
    return out;
}

py::tuple eval_many(const Closures& c, const Floats& wi) {
    if (wi.ndim() != 2 || wi.shape(1) != 3) throw std::invalid_argument("directions have the shape (N, 3)");
    py::ssize_t count = wi.shape(0);
    py::array_t<float> value({count, py::ssize_t(3), py::ssize_t(3)}), pdf(count);
    auto w = wi.unchecked<2>();
    auto v = value.mutable_unchecked<3>();
    auto p = pdf.mutable_unchecked<1>();
    for (py::ssize_t i = 0; i < count; ++i) {
        float density = 0.0f;
        BsdfValue b = eval_closures(c.set, c.context.ng, c.context.wo, {w(i, 0), w(i, 1), w(i, 2)}, &density);
        const Color classes[3] = {b.diffuse, b.glossy, b.transmission};
        for (int k = 0; k < 3; ++k)
            for (int channel = 0; channel < 3; ++channel) v(i, k, channel) = classes[k][channel];
        p(i) = density;
    }
    return py::make_tuple(value, pdf);
}

py::dict sample_many(const Closures& c, const Floats& u) {
    if (u.ndim() != 2 || u.shape(1) != 3) throw std::invalid_argument("random numbers have the shape (N, 3)");
    py::ssize_t count = u.shape(0);
    py::array_t<float> direction({count, py::ssize_t(3)}), throughput({count, py::ssize_t(3)}), pdf(count),
        roughness(count), eta(count);
    py::array_t<int> lobe_class(count);
    py::array_t<bool> delta(count), transmitted(count);
    auto r = u.unchecked<2>();
    for (py::ssize_t i = 0; i < count; ++i) {
        BsdfSample s = sample_closures(c.set, c.context.ng, c.context.wo, r(i, 0), {r(i, 1), r(i, 2)});
        for (int k = 0; k < 3; ++k) {
            direction.mutable_at(i, k) = s.direction[k];
            throughput.mutable_at(i, k) = s.throughput[k];
        }
        pdf.mutable_at(i) = s.pdf_sa;
        roughness.mutable_at(i) = s.roughness;
        eta.mutable_at(i) = s.eta;
        lobe_class.mutable_at(i) = s.lobe_class;
        delta.mutable_at(i) = s.delta;
        transmitted.mutable_at(i) = s.transmitted;
    }
    py::dict out;
    out["direction"] = direction;
    out["throughput"] = throughput;
    out["pdf"] = pdf;
    out["roughness"] = roughness;
    out["eta"] = eta;
    out["lobe_class"] = lobe_class;
    out["delta"] = delta;
    out["transmitted"] = transmitted;
    return out;
}

py::tuple tuple_of(Vec3 v) { return py::make_tuple(v.x, v.y, v.z); }

}  // namespace

void bind_bsdf(py::module_& m) {
    auto bsdf = m.def_submodule("bsdf", "Surface closures at one shading point.");
    py::class_<Closures>(bsdf, "Closures")
        .def(py::init(&make_closures), py::arg("node"), py::arg("inputs") = py::dict(),
             py::arg("wo") = py::make_tuple(0, 0, 1), py::arg("n") = py::make_tuple(0, 0, 1),
             py::arg("ng") = py::make_tuple(0, 0, 1), py::arg("path_flags") = u32(PATH_CAMERA),
             py::arg("caustics_reflective") = true, py::arg("caustics_refractive") = true,
             py::arg("bump_correction") = true)
        .def_property_readonly("count", [](const Closures& c) { return c.set.count; })
        .def_property_readonly("emission", [](const Closures& c) { return tuple_of(c.set.emission); })
        .def_property_readonly("transparent", [](const Closures& c) { return tuple_of(c.set.transparent); })
        .def_property_readonly("holdout", [](const Closures& c) { return c.set.holdout; })
        .def_property_readonly("normal", [](const Closures& c) { return tuple_of(shading_normal(c.set, c.context.n)); })
        .def("eval", &eval_many, "f |cos| per class (N, 3, 3) and density (N,) of directions (N, 3).")
        .def("sample", &sample_many, "Draws for random numbers (N, 3): lobe, then the two of the direction.")
        .def("blur", [](Closures& c, float alpha) { blur_closures(c.set, alpha); })
        .def("albedo",
             [](const Closures& c) {
                 BsdfValue v = closure_albedo(c.set, c.context.wo);
                 return py::make_tuple(tuple_of(v.diffuse), tuple_of(v.glossy), tuple_of(v.transmission));
             })
        .def(
            "limit_lobes",
            [](Closures& c, int copies) {
                for (int i = 0; i < copies; ++i)
                    setup_diffuse(c.set, make_vec3(1.0f / static_cast<float>(i + 1)), make_vec3(1.0f), 0.0f,
                                  make_vec3(0.0f), c.context);
                return c.set.count;
            },
            "Adds diffuse lobes of falling weight; returns how many lobes the set holds.");
}

}  // namespace luch::bindings
