#include "cpu/film.h"

#include <algorithm>
#include <atomic>
#include <stdexcept>

namespace luch::cpu {
namespace {

enum Group : u8 { NEITHER, LIGHT_PASS, DATA_PASS };

// Every pass of fixed name: one line each.
struct Known {
    const char* name;
    u32 channels;
    PassKind kind;
    u32 FilmLayout::* channel;
    u32 FilmLayout::* divisor;  // of the colour that is divided out
    Group group;
};

constexpr u32 FilmLayout::* nothing = nullptr;
const Known known_passes[] = {
    {"Depth", 1, PassKind::DEPTH, &FilmLayout::depth, nothing, DATA_PASS},
    {"Mist", 1, PassKind::MIST, &FilmLayout::mist, nothing, DATA_PASS},
    {"Position", 3, PassKind::FIRST, &FilmLayout::position, nothing, DATA_PASS},
    {"Normal", 3, PassKind::MEAN, &FilmLayout::normal, nothing, DATA_PASS},
    {"UV", 3, PassKind::MEAN, &FilmLayout::uv, nothing, DATA_PASS},
    {"Object Index", 1, PassKind::FIRST, &FilmLayout::object_index, nothing, DATA_PASS},
    {"Material Index", 1, PassKind::FIRST, &FilmLayout::material_index, nothing, DATA_PASS},
    {"Emission", 3, PassKind::LIGHT, &FilmLayout::emission, nothing, LIGHT_PASS},
    {"Environment", 3, PassKind::LIGHT, &FilmLayout::environment, nothing, LIGHT_PASS},
    {"Ambient Occlusion", 3, PassKind::MEAN, &FilmLayout::ambient_occlusion, nothing, LIGHT_PASS},
    {"Diffuse Direct", 3, PassKind::DIVIDED_LIGHT, &FilmLayout::diffuse_direct, &FilmLayout::diffuse_color, LIGHT_PASS},
    {"Diffuse Indirect", 3, PassKind::DIVIDED_LIGHT, &FilmLayout::diffuse_indirect, &FilmLayout::diffuse_color,
     LIGHT_PASS},
    {"Diffuse Color", 3, PassKind::MEAN, &FilmLayout::diffuse_color, nothing, DATA_PASS},
    {"Glossy Direct", 3, PassKind::DIVIDED_LIGHT, &FilmLayout::glossy_direct, &FilmLayout::glossy_color, LIGHT_PASS},
    {"Glossy Indirect", 3, PassKind::DIVIDED_LIGHT, &FilmLayout::glossy_indirect, &FilmLayout::glossy_color,
     LIGHT_PASS},
    {"Glossy Color", 3, PassKind::MEAN, &FilmLayout::glossy_color, nothing, DATA_PASS},
    {"Transmission Direct", 3, PassKind::DIVIDED_LIGHT, &FilmLayout::transmission_direct,
     &FilmLayout::transmission_color, LIGHT_PASS},
    {"Transmission Indirect", 3, PassKind::DIVIDED_LIGHT, &FilmLayout::transmission_indirect,
     &FilmLayout::transmission_color, LIGHT_PASS},
    {"Transmission Color", 3, PassKind::MEAN, &FilmLayout::transmission_color, nothing, DATA_PASS},
    {"Volume Direct", 3, PassKind::LIGHT, &FilmLayout::volume_direct, nothing, LIGHT_PASS},
    {"Volume Indirect", 3, PassKind::LIGHT, &FilmLayout::volume_indirect, nothing, LIGHT_PASS},
    {"Denoising Albedo", 3, PassKind::MEAN, &FilmLayout::denoising_albedo, nothing, DATA_PASS},
    {"Denoising Normal", 3, PassKind::MEAN, &FilmLayout::denoising_normal, nothing, DATA_PASS},
    {"Denoising Depth", 1, PassKind::MEAN, &FilmLayout::denoising_depth, nothing, DATA_PASS},
    {"Render Time", 1, PassKind::TOTAL, &FilmLayout::time, nothing, NEITHER},
};

struct KnownCrypto {
    const char* prefix;
    u32 FilmLayout::* channel;
};
const KnownCrypto known_cryptos[] = {
    {"CryptoObject", &FilmLayout::crypto_object},
    {"CryptoMaterial", &FilmLayout::crypto_material},
    {"CryptoAsset", &FilmLayout::crypto_asset},
};

// Hands out channels and passes in the order in which they are asked for.
class LayoutBuilder {
 public:
    explicit LayoutBuilder(const FilmSpec& spec) : spec_(spec) {
        for (const Known& known : known_passes) layout.*known.channel = NONE;
        for (const KnownCrypto& crypto : known_cryptos) layout.*crypto.channel = NONE;
        layout.marks = layout.lightgroups = layout.aovs = NONE;
        layout.combined = take(4);
        passes.push_back({"Combined", {PassKind::COMBINED, 4, layout.combined}});
        if (spec.marks) layout.marks = take(MARKS * MARK_CHANNELS);
    }

    void add(const std::string& name) {
        if (exists(name) || is_named_elsewhere(name)) return;
        if (name == "Sample Count" || name == "Debug Sample Count") {
            passes.push_back({name, {PassKind::SAMPLE_COUNT, 1, NONE}});
            return;
        }
        if (add_known(name) || add_crypto(name)) return;
        throw std::invalid_argument("Film: pass \"" + name +
                                    "\" is not known. Use Blender's names, e.g. \"Diffuse Direct\".");
    }

    void add_lightgroups() {
        layout.lightgroup_count = static_cast<u32>(spec_.lightgroups.size());
        if (spec_.lightgroups.empty()) return;
        layout.lightgroups = take(3 * layout.lightgroup_count);
        layout.any_light_pass = 1;
        for (u32 i = 0; i < layout.lightgroup_count; ++i)
            add_named({"Combined_" + spec_.lightgroups[i], {PassKind::LIGHT, 3, layout.lightgroups + 3 * i}});
    }

    void add_aovs() {
        layout.aov_count = static_cast<u32>(spec_.aovs.size());
        if (spec_.aovs.empty()) return;
        layout.aovs = take(4 * layout.aov_count);
        layout.any_data_pass = 1;
        for (u32 i = 0; i < layout.aov_count; ++i)
            add_named({spec_.aovs[i].name, {PassKind::MEAN, spec_.aovs[i].color ? 4u : 1u, layout.aovs + 4 * i}});
    }

    FilmLayout layout{};
    std::vector<Pass> passes;

 private:
    bool exists(const std::string& name) const {
        return std::any_of(passes.begin(), passes.end(), [&](const Pass& pass) { return pass.name == name; });
    }

    void add_named(const Pass& pass) {
        if (exists(pass.name))
            throw std::invalid_argument("Film: two passes are named \"" + pass.name + "\". Rename one.");
        passes.push_back(pass);
    }

    u32 take(u32 channels) {
        u32 first = layout.stride;
        layout.stride += channels;
        return first;
    }

    bool add_known(const std::string& name) {
        for (const Known& known : known_passes) {
            if (name != known.name) continue;
            if (layout.*known.channel == NONE) layout.*known.channel = take(known.channels);
            u32 divisor = NONE;
            if (known.divisor) {
                if (layout.*known.divisor == NONE) layout.*known.divisor = take(3);  // summed, though not shown
                divisor = layout.*known.divisor;
                layout.any_data_pass = 1;
            }
            if (known.group != NEITHER) (known.group == LIGHT_PASS ? layout.any_light_pass : layout.any_data_pass) = 1;
            passes.push_back({name, {known.kind, known.channels, layout.*known.channel, divisor}});
            return true;
        }
        return false;
    }

    // "CryptoObject" or "CryptoObject00": all layers of that cryptomatte, two slots each.
    bool add_crypto(const std::string& name) {
        for (const KnownCrypto& crypto : known_cryptos) {
            std::string prefix = crypto.prefix;
            if (name.compare(0, prefix.size(), prefix) != 0) continue;
            if (name.size() > prefix.size() + 2 ||
                name.find_first_not_of("0123456789", prefix.size()) != std::string::npos)
                continue;
            if (layout.*crypto.channel != NONE) return true;
            layout.crypto_slots = 2u * ((std::clamp(spec_.cryptomatte_depth, 1u, MOST_CRYPTO_SLOTS) + 1u) / 2u);
            layout.*crypto.channel = take(2 * layout.crypto_slots);
            layout.any_data_pass = 1;
            for (u32 layer = 0; layer < layout.crypto_slots / 2; ++layer) {
                const char number[] = {'0', static_cast<char>('0' + layer), '\0'};  // at most 8 layers
                passes.push_back({prefix + number, {PassKind::CRYPTO, 4, layout.*crypto.channel, NONE, layer}});
            }
            return true;
        }
        return false;
    }

    // Names of light groups and AOVs are kept in their own lists; a list of passes may repeat them.
    bool is_named_elsewhere(const std::string& name) const {
        for (const std::string& group : spec_.lightgroups)
            if (name == "Combined_" + group) return true;
        for (const FilmSpec::Aov& aov : spec_.aovs)
            if (name == aov.name) return true;
        return false;
    }

    const FilmSpec& spec_;
};

}  // namespace

Film::Film(const FilmSpec& spec) : spec_(spec) {
    if (spec.width == 0 || spec.height == 0)
        throw std::invalid_argument("Film: the rendered region is empty. Give it at least one pixel.");
    LayoutBuilder builder(spec);
    for (const std::string& name : spec.passes) builder.add(name);
    builder.add_lightgroups();
    builder.add_aovs();
    layout_ = builder.layout;
    passes_ = std::move(builder.passes);
    u64 pixels = static_cast<u64>(spec.width) * spec.height;
    if (pixels >= NONE) throw std::invalid_argument("Film: more than 2^32 pixels. Render it in parts, with a border.");
    rows_.reset(static_cast<FilmSum*>(std::calloc(pixels * layout_.stride, sizeof(FilmSum))));
    if (!rows_) throw std::bad_alloc();
    counts_.assign(pixels, 0);
}

FilmView Film::view() {
    FilmView view{};
    view.rows = rows_.get();
    view.sample_counts = counts_.data();
    view.layout = layout_;
    view.width = spec_.width, view.height = spec_.height;
    view.x0 = spec_.x0, view.y0 = spec_.y0;
    for (int k = 0; k < 3; ++k) view.origin[k] = spec_.origin[k];
    return view;
}

void Film::resolve(const std::vector<float*>& out, ThreadPool& pool) const {
    // Pass after pass over a block of rows that stays in the second-level cache.
    pool.parallel_for(counts_.size(), 128, [&](size_t begin, size_t end, unsigned) {
        for (size_t i = 0; i < passes_.size(); ++i) {
            const PassSource& pass = passes_[i].from;
            float* to = out[i] + begin * pass.channels;
            for (size_t pixel = begin; pixel < end; ++pixel, to += pass.channels) {
                if (counts_[pixel] == 0) {
                    std::fill(to, to + pass.channels, 0.0f);
                } else {
                    read_pixel(pass, rows_.get() + pixel * layout_.stride, layout_, counts_[pixel], spec_.exposure, to);
                }
            }
        }
    });
}

double Film::deviations(float* mean, float* deviation, ThreadPool& pool) const {
    if (layout_.marks == NONE) throw std::logic_error("Film: no marks were kept.");
    std::atomic<u64> before{0}, all{0};
    pool.parallel_for(counts_.size(), 1024, [&](size_t begin, size_t end, unsigned) {
        u64 own_before = 0, own_all = 0;
        for (size_t pixel = begin; pixel < end; ++pixel) {
            MarkedSamples marked = read_deviation(rows_.get() + pixel * layout_.stride, layout_, counts_[pixel],
                                                  spec_.exposure, mean + 3 * pixel, deviation + 3 * pixel);
            own_before += marked.before, own_all += marked.all;
        }
        before += own_before, all += own_all;
    });
    return all > 0 ? double(before) / double(all) : 0.0;
}

void Film::merge(const Film& other) {
    if (other.counts_.size() != counts_.size() || other.layout_.stride != layout_.stride ||
        other.passes_.size() != passes_.size())
        throw std::invalid_argument("Film: only films of the same size and passes merge.");
    FilmWriter writer{view(), nullptr};
    FilmView from = view();
    from.rows = other.rows_.get();
    from.sample_counts = const_cast<u32*>(other.counts_.data());  // only read
    for (size_t pixel = 0; pixel < counts_.size(); ++pixel) film_merge_pixel(writer, from, static_cast<u32>(pixel));
}

}  // namespace luch::cpu
