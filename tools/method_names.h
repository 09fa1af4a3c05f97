#pragma once

// How the settings that change the noise of a picture, and not its mean, are called on command lines.

#include <map>
#include <string>

#include "pipeline/scene.h"

namespace spillway::tools {

inline const std::map<std::string, pipeline::LightSelection> kLightSelections = {
    {"tree", pipeline::LightSelection::tree},
    {"power", pipeline::LightSelection::power},
    {"uniform", pipeline::LightSelection::uniform}};

inline const std::map<std::string, pipeline::Estimator> kEstimators = {
    {"mis-power", pipeline::Estimator::mis_power}, {"mis-balance", pipeline::Estimator::mis_balance},
    {"light", pipeline::Estimator::light},         {"light-by-area", pipeline::Estimator::light_by_area},
    {"bsdf", pipeline::Estimator::bsdf},           {"hemisphere", pipeline::Estimator::hemisphere}};

inline const std::map<std::string, pipeline::TextureFilter> kTextureFilters = {
    {"of-texture", pipeline::TextureFilter::of_texture},
    {"point", pipeline::TextureFilter::point},
    {"bilinear", pipeline::TextureFilter::bilinear},
    {"trilinear", pipeline::TextureFilter::trilinear}};

inline const std::map<std::string, pipeline::MajorantExtent> kMajorants = {{"cell", pipeline::MajorantExtent::cell},
                                                                           {"brick", pipeline::MajorantExtent::brick},
                                                                           {"grid", pipeline::MajorantExtent::grid}};

}  // namespace spillway::tools
